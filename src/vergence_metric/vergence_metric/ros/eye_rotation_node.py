"""eye_rotation_node: pairs of images in, the measured rotation of the eyes to one another out, a few times a second."""

from collections.abc import Sequence
from typing import Any

from vergence_common.diagnostics import ERROR, OK, WARN, Diagnostics, Report
from vergence_common.node_main import run_node
from vergence_common.parameters import ParameterSet, declare
from vergence_common.qos import watch_qos
from vergence_metric.eye_rotation.encoder import VisualEncoder
from vergence_metric.eye_rotation.pair_selection import PairSelection
from vergence_metric.eye_rotation.parameters import (
    GROUPS,
    AcceptanceParameters,
    CalibrationPriorParameters,
    EncoderParameters,
    EyeRotationNodeParameters,
    MatchingParameters,
    RestParameters,
)
from vergence_metric.eye_rotation.resting_pairs import measure_pair
from vergence_metric.pairs.latest_worker import LatestWorker
from vergence_metric.pairs.parameters import PairingParameters
from vergence_metric.ros.eye_rotation_messages import eye_rotation_message
from vergence_metric.ros.image_pair import ImagePair
from vergence_metric.ros.metric_node import MetricNode, limit_threads
from vergence_metric.ros.stereo_input import StereoInput
from vergence_msgs.msg import EyeRotation
from vergence_rig.rig_file import load_rig


class EyeRotationNode(MetricNode):
    """Measures `rate_hz` pairs a second on its own thread; the pair before each shows the image's motion."""

    def __init__(self, **options: Any) -> None:
        super().__init__("eye_rotation_node", **options)
        self._settings = declare(self, GROUPS)
        root = self._settings.get(EyeRotationNodeParameters)
        limit_threads(root.threads)
        self._rig = load_rig(root.rig)
        self._encoder = VisualEncoder(_encoder_parameters(self._settings), self._rig)
        self._selection: PairSelection[ImagePair] = PairSelection(root.rate_hz)
        self._counts: dict[str, int] = {}
        self._last = "nothing measured yet"
        diagnostics = Diagnostics(self)
        qos = watch_qos(self, diagnostics)
        self._publisher = self._output(qos, EyeRotation, "vergence/eye_rotation")
        self._worker: LatestWorker[tuple[ImagePair, ImagePair]] = LatestWorker(
            self._measure, self._on_failure, "encoder"
        )
        pairing = self._settings.get(PairingParameters)
        self._stereo = StereoInput(
            self, root, pairing, diagnostics, qos, self._on_pair, self._rig, self._selection.is_due, self._images
        )
        self._joint_input = self._subscribe_joints(diagnostics, qos)
        self._settings.on_change(self._on_settings)
        diagnostics.add("encoder", self._report)
        diagnostics.add("outputs", self._report_outputs)

    def _on_settings(self, settings: ParameterSet) -> None:
        root = settings.get(EyeRotationNodeParameters)
        limit_threads(root.threads)
        self._encoder = VisualEncoder(_encoder_parameters(settings), self._rig)
        self._selection.rate_hz = root.rate_hz
        self._stereo.set_parameters(root, settings.get(PairingParameters))

    def _on_pair(self, pair: ImagePair) -> None:
        two = self._selection.add(pair.left_stamp_ns, pair)
        if two is not None:
            self._worker.submit(two)

    def _measure(self, two: tuple[ImagePair, ImagePair]) -> None:
        before, pair = two
        models = self._stereo.cameras.calibrated(pair)
        rest = self._settings.get(RestParameters)
        with self._times.measure("pair"):
            reading = measure_pair(self._encoder, rest, before, pair, self._joints, models)
        self._counts[reading.status.name] = self._counts.get(reading.status.name, 0) + 1
        self._last = reading.reason or "measured"
        self._publisher.publish(eye_rotation_message(reading, pair.left.header, pair.skew_ns * 1e-9))
        self._failure = None

    def _report(self) -> Report:
        values: dict[str, object] = {name.lower(): count for name, count in self._counts.items()}
        values["last"] = self._last
        values |= self._times.summary()
        if self._failure is not None:
            return Report(ERROR, f"measuring the last pair failed: {self._failure}", values)
        if self._counts.get("CONTRADICTORY", 0) > self._counts.get("OK", 0):
            return Report(WARN, f"measured rotations contradict the joint angles: {self._last}", values)
        return Report(
            OK, f"eye rotation measured in {self._counts.get('OK', 0)} of {self._worker.worked} pairs", values
        )


def _encoder_parameters(settings: ParameterSet) -> EncoderParameters:
    return EncoderParameters(
        settings.get(MatchingParameters),
        settings.get(CalibrationPriorParameters),
        settings.get(AcceptanceParameters),
    )


def main(args: Sequence[str] | None = None) -> int:
    """Run the node; see `vergence_common.node_main`."""
    return run_node(EyeRotationNode, args, GROUPS)
