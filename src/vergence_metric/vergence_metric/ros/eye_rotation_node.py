"""eye_rotation_node: pairs of images in, how the eyes really stand to one another out, a few times a second."""

from collections.abc import Sequence
from typing import Any

import cv2
from sensor_msgs.msg import JointState

from vergence_common.diagnostics import ERROR, OK, WARN, Diagnostics, Report
from vergence_common.node_main import run_node
from vergence_common.parameters import ParameterSet, declare
from vergence_common.qos import watch_qos
from vergence_metric.eye_rotation.encoder import VisualEncoder
from vergence_metric.eye_rotation.pair_choice import PairChoice
from vergence_metric.eye_rotation.parameters import GROUPS, EyeRotationNodeParameters
from vergence_metric.eye_rotation.resting_pairs import measure_pair
from vergence_metric.pairs.latest_worker import LatestWorker
from vergence_metric.ros.metric_messages import eye_rotation_message
from vergence_metric.ros.pair_node import PairNode
from vergence_metric.ros.stereo_input import ImagePair, StereoInput
from vergence_msgs.msg import EyeRotation
from vergence_rig.rig import load_rig


class EyeRotationNode(PairNode):
    """Measures two pairs in a row, `rate_hz` times a second, on a thread of its own; the first tells of motion only."""

    def __init__(self, **options: Any) -> None:
        super().__init__("eye_rotation_node", **options)
        self._settings = declare(self, GROUPS)
        settings: EyeRotationNodeParameters = self._settings.value
        cv2.setNumThreads(settings.threads or -1)
        self._rig = load_rig(settings.rig)
        self._encoder = VisualEncoder(settings, self._rig)
        self._choice: PairChoice[ImagePair] = PairChoice(settings.rate_hz)
        self._counts: dict[str, int] = {}
        self._last = "nothing measured yet"
        diagnostics = Diagnostics(self)
        qos = watch_qos(self, diagnostics)
        self._publisher = qos.create_publisher(EyeRotation, "vergence/eye_rotation")
        self._worker: LatestWorker[tuple[ImagePair, ImagePair]] = LatestWorker(
            self._measure, self._on_failure, "encoder"
        )
        self._stereo = StereoInput(self, settings, diagnostics, qos, self._on_pair, self._choice.wants)
        self._joint_subscription = qos.create_subscription(JointState, "joint_states", self._on_joints)
        self._settings.on_change(self._on_settings)
        diagnostics.add("encoder", self._report)

    def _on_settings(self, settings: ParameterSet) -> None:
        values: EyeRotationNodeParameters = settings.value
        cv2.setNumThreads(values.threads or -1)
        self._encoder = VisualEncoder(values, self._rig)
        self._choice.rate_hz = values.rate_hz
        self._stereo.set_parameters(values)

    def _on_pair(self, pair: ImagePair) -> None:
        two = self._choice.take(pair.left_stamp_ns, pair)
        if two is not None:
            self._worker.submit(two)

    def _measure(self, two: tuple[ImagePair, ImagePair]) -> None:
        before, pair = two
        models = self._stereo.models_for(pair.left.pixels)
        with self._times.measure("pair"):
            reading = measure_pair(self._encoder, before, pair, self._joints, models)
        self._counts[reading.status.name] = self._counts.get(reading.status.name, 0) + 1
        self._last = reading.reason or "measured"
        self._publisher.publish(eye_rotation_message(reading, pair.left.header, pair.skew_ns * 1e-9))
        self._failure = None

    def _report(self) -> Report:
        values: dict[str, object] = {name.lower(): count for name, count in self._counts.items()}
        values["last"] = self._last
        values |= self._times.summary()
        if self._failure is not None:
            return Report(ERROR, f"the last pair could not be measured: {self._failure}", values)
        if self._counts.get("CONTRADICTORY", 0) > self._counts.get("OK", 0):
            return Report(WARN, f"the joints are not where they say: {self._last}", values)
        return Report(OK, f"{self._counts.get('OK', 0)} of {self._worker.worked} pairs tell the eyes' rotation", values)


def main(args: Sequence[str] | None = None) -> int:
    """Run the node; see `vergence_common.node_main`."""
    return run_node(EyeRotationNode, args)
