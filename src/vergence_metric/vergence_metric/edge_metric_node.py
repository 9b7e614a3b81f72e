"""edge_metric_node: pairs of images in, metric I, the signed error of the fovea and the followed target out."""

import traceback
from collections.abc import Sequence
from time import monotonic_ns
from typing import Any

import cv2
from rclpy.node import Node
from sensor_msgs.msg import Image

from vergence_common.diagnostics import ERROR, OK, WARN, Diagnostics, Report
from vergence_common.images import array_to_image
from vergence_common.node_main import run_node
from vergence_common.parameters import ParameterSet, declare
from vergence_common.qos import IMAGE_QOS, watch_qos
from vergence_metric.disparity import make_estimator
from vergence_metric.edge_metric import EdgeMetric
from vergence_metric.edge_node_parameters import EdgeMetricNodeParameters
from vergence_metric.latest_worker import LatestWorker
from vergence_metric.metric_messages import edge_message, error_message
from vergence_metric.overlay import draw_overlay
from vergence_metric.stage_times import StageTimes
from vergence_metric.stereo_messages import ImagePair, StereoInput
from vergence_metric.viewing_angles import angular_disparity
from vergence_msgs.msg import EdgeVergence, VergenceError
from vergence_rig.rig import default_rig, load_rig


class EdgeMetricNode(Node):
    """Measures the newest pair on a thread of its own; the executor's thread only takes images and pairs them."""

    def __init__(self, **options: Any) -> None:
        super().__init__("edge_metric_node", **options)
        self._settings = declare(self, EdgeMetricNodeParameters)
        self._apply(self._settings.value)
        self._rig = load_rig(self._current.rig) if self._current.rig else default_rig()
        self._times = StageTimes()
        self._failure: str | None = None
        diagnostics = Diagnostics(self)
        qos = watch_qos(self, diagnostics)
        self._edge_publisher = qos.create_publisher(EdgeVergence, "vergence/edge")
        self._error_publisher = qos.create_publisher(VergenceError, "vergence/error")
        self._overlay_publisher = qos.create_publisher(Image, "vergence/overlay", IMAGE_QOS)
        self._worker: LatestWorker[ImagePair] = LatestWorker(self._measure, self._on_failure, "measure")
        self._input = StereoInput(self, self._current, diagnostics, qos, self._worker.submit)
        self._settings.on_change(self._on_parameters)
        diagnostics.add("measurement", self._report)

    def close(self) -> None:
        """End the measuring thread."""
        self._worker.close()

    def _apply(self, parameters: EdgeMetricNodeParameters) -> None:
        cv2.setNumThreads(parameters.threads if parameters.threads else -1)
        self._metric = EdgeMetric(parameters)
        self._estimator = make_estimator(parameters)
        self._current = parameters

    def _on_parameters(self, parameters: ParameterSet) -> None:
        self._input.set_parameters(parameters.value)

    def _measure(self, pair: ImagePair) -> None:
        wanted = self._settings.value
        if wanted is not self._current:
            self._apply(wanted)
        header, skew_s = pair.left.header, pair.skew_ns * 1e-9
        with self._times.measure("metric"):
            result = self._metric.measure(pair.left.pixels, pair.right.pixels)
        with self._times.measure("publish"):
            self._edge_publisher.publish(edge_message(result, header, skew_s))
        self._times.add_all(result.stage_s)
        self._times.add("until_edge", (monotonic_ns() - max(pair.left.arrived_ns, pair.right.arrived_ns)) * 1e-9)
        with self._times.measure("disparity"):
            disparity = self._estimator.estimate(result.left_grey, result.right_grey)
        models = self._input.models_for(pair.left.pixels)
        angular = models and angular_disparity(
            *models, disparity.point_px, disparity.horizontal_px, disparity.vertical_px
        )
        self._error_publisher.publish(error_message(disparity, angular, header, skew_s))
        if self._overlay_publisher.get_subscription_count():
            with self._times.measure("overlay"):
                picture = draw_overlay(pair.left.pixels, result, disparity)
                self._overlay_publisher.publish(array_to_image(picture, header))
        self._failure = None

    def _on_failure(self, error: Exception) -> None:
        self._failure = f"{type(error).__name__}: {error}"
        text = "".join(traceback.format_exception(error))
        self.get_logger().error(f"a pair could not be measured:\n{text}", throttle_duration_sec=10.0)

    def _report(self) -> Report:
        worked, dropped = self._worker.worked, self._worker.dropped
        values: dict[str, object] = {"measured": worked, "dropped": dropped}
        values |= self._input.decode_times.summary() | self._times.summary()
        if self._failure is not None:
            return Report(ERROR, f"the last pair could not be measured: {self._failure}", values)
        if dropped:
            return Report(WARN, f"too slow: {dropped} of {worked + dropped} pairs were left out", values)
        return Report(OK, f"{worked} pairs measured", values)


def main(args: Sequence[str] | None = None) -> int:
    """Run the node; see `vergence_common.node_main`."""
    return run_node(EdgeMetricNode, args)
