"""Base of the nodes that measure pairs of images: joint history, stage times, and the report of a failed pair."""

import os
import traceback
from time import monotonic
from typing import Any

import cv2
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile

from vergence_common.blas_threads import limit_blas_threads
from vergence_common.diagnostics import OK, Diagnostics, Report
from vergence_common.joint_states import JointStateInput, MergedJoints
from vergence_common.local_images import LocalImages
from vergence_common.qos import STATE_QOS, QosWatch
from vergence_metric.pairs.latest_worker import LatestWorker
from vergence_metric.pairs.stage_times import StageTimes
from vergence_metric.ros.stereo_input import StereoInput
from vergence_rig.joint_history import JointHistory
from vergence_rig.rig import JOINT_NAMES, Rig

_UNHEARD_S = 5.0  # without subscribers, until no images are received


def limit_threads(count: int) -> None:
    """Let OpenCV and BLAS use at most `count` threads for one operation; 0 is one for each core."""
    cv2.setNumThreads(count or -1)
    limit_blas_threads(count or os.cpu_count() or 1)


class MetricNode(Node):
    """Measures pairs on its own thread; without subscribers of its outputs it soon receives no images.

    Subclasses must set `_rig`, `_worker` and `_stereo`, make their publishers by `_output`, and clear `_failure` after
    a measured pair.
    """

    _worker: LatestWorker[Any]
    _stereo: StereoInput

    _rig: Rig

    def __init__(self, name: str, images: LocalImages | None = None, **options: Any) -> None:
        super().__init__(name, **options)
        self._images = images
        self._joints = JointHistory()
        self._times = StageTimes()
        self._failure: str | None = None
        self._outputs: list[Publisher] = []
        self._heard_s = monotonic()

    def close(self) -> None:
        """End the measuring thread."""
        self._worker.close()

    def destroy_node(self) -> None:
        """Destroy the subscriptions, too, that rclpy's node does not know of."""
        self._stereo.close()
        super().destroy_node()

    def _output(self, qos: QosWatch, kind: Any, topic: str, profile: QoSProfile = STATE_QOS) -> Publisher:
        """Return a publisher of something that is measured."""
        self._outputs.append(qos.create_publisher(kind, topic, profile, matched=self._on_matched))
        return self._outputs[-1]

    def _subscribers(self) -> int:
        return sum(publisher.get_subscription_count() for publisher in self._outputs)

    def _may_pause(self) -> bool:
        """Return whether images need not be received while no output has a subscriber."""
        return True

    def _on_matched(self, _: object) -> None:
        if self._subscribers():
            self._heard_s = monotonic()
            self._stereo.resume()

    def _report_outputs(self) -> Report:
        """Report the subscribers of the outputs, and follow them: not every middleware reports matches."""
        subscribers, now_s = self._subscribers(), monotonic()
        if subscribers:
            self._heard_s = now_s
            self._stereo.resume()
        elif now_s - self._heard_s > _UNHEARD_S and self._may_pause():
            self._stereo.pause()
        if self._stereo.paused:
            return Report(OK, "nothing is measured: no output has a subscriber", {"subscribers": 0})
        return Report(OK, f"{subscribers} subscribers", {"subscribers": subscribers})

    def _subscribe_joints(self, diagnostics: Diagnostics, qos: QosWatch) -> JointStateInput:
        """Return the subscription of joint_states, which fills the history."""
        return JointStateInput(self, diagnostics, qos, self._on_joints)

    def _on_joints(self, merged: MergedJoints) -> None:
        self._joints.add(merged.stamp_ns, JOINT_NAMES, self._rig.eye_angles(merged.angles_rad))

    def _on_failure(self, error: Exception) -> None:
        if not self.context.ok():
            return  # shut down while a pair was being measured
        self._failure = f"{type(error).__name__}: {error}"
        text = "".join(traceback.format_exception(error))
        self.get_logger().error(f"measuring a pair failed:\n{text}", throttle_duration_sec=10.0)
