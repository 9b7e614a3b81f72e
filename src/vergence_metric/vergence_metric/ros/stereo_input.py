"""Image messages of both eyes to pairs of arrays; shared by the nodes that measure pairs."""

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass
from functools import partial
from time import monotonic, monotonic_ns
from typing import Any

import numpy as np
import numpy.typing as npt
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription
from sensor_msgs.msg import CompressedImage, Image
from std_msgs.msg import Header

from vergence_common.awaited import report_awaited
from vergence_common.camera_infos import CameraInfoInput
from vergence_common.diagnostics import ERROR, OK, WARN, Diagnostics, Report
from vergence_common.images import ImageError, compressed_to_array, image_to_array
from vergence_common.local_images import LocalImages
from vergence_common.qos import IMAGE_QOS, QosWatch
from vergence_common.stamps import to_nanoseconds
from vergence_metric.pairs.pairing import LEFT, RIGHT, Pair, StereoPairer
from vergence_metric.pairs.parameters import PairingParameters, StereoParameters
from vergence_metric.pairs.stage_times import StageTimes
from vergence_metric.pairs.stream_health import StreamHealth
from vergence_metric.ros.image_pair import SIDES, ImageFrame, ImagePair
from vergence_metric.ros.stereo_cameras import StereoCameras
from vergence_rig.rig import Rig

_SOURCES = (
    "Images come from camera_node (rig.launch.py), sim_node (sim.launch.py), photo_node or another camera's driver"
)


@dataclass(frozen=True, slots=True)
class _Undecoded:
    """One eye's image message and its time of arrival [ns, monotonic]."""

    message: Any
    arrived_ns: int


class StereoInput:
    """Subscribes both eyes, passes each pair of images to `on_pair`, and adds diagnostics of the input.

    `on_pair` runs in the executor's thread and should only hand the pair on. With `is_due`, only pairs for whose left
    stamp [ns] it is true are decoded; the others only count as received. With `images`, those that a node of this
    process has are taken from there; others are subscribed, decoded at once and handed on.
    """

    def __init__(
        self,
        node: Node,
        stereo: StereoParameters,
        pairing: PairingParameters,
        diagnostics: Diagnostics,
        qos: QosWatch,
        on_pair: Callable[[ImagePair], None],
        rig: Rig,
        is_due: Callable[[int], bool] | None = None,
        images: LocalImages | None = None,
    ) -> None:
        self.cameras = StereoCameras(rig, node.get_logger(), lambda side: self._health[side].size_px)
        self.decode_times = StageTimes()
        self._node = node
        self._stereo, self._pairing = stereo, pairing
        self._on_pair = on_pair
        self._is_due = is_due
        self._pairer: StereoPairer[Any] = StereoPairer(pairing)
        self._size_mismatch: str | None = None
        self._size_mismatches = 0
        self._deadline = node.create_timer(
            1.0, self._on_deadline, clock=Clock(clock_type=ClockType.STEADY_TIME), autostart=False
        )
        compressed = stereo.image_transport == "compressed"
        message_type, suffix = (CompressedImage, "image_raw/compressed") if compressed else (Image, "image_raw")
        self._to_pixels: Callable[[Any], npt.NDArray[np.uint8]] = compressed_to_array if compressed else image_to_array
        self._health = tuple(StreamHealth(f"{name}/{suffix}", monotonic()) for name in SIDES)
        self._subscriptions: list[Subscription] = []
        self._infos: list[CameraInfoInput] = []
        self._local: list[tuple[str, Any]] = []
        self.resumed_ns = -1_000_000_000
        """ROS time of the last `resume` [ns]; far in the past where there was none."""
        self._images, self._topics = images, [node.resolve_topic_name(f"{name}/image_raw") for name in SIDES]
        self._lock = images.lock if images else nullcontext()
        self._connect = partial(self._subscribe_all, qos, message_type, suffix, images)
        self._connect()
        for side, name in enumerate(SIDES):
            diagnostics.add(f"{name} images", lambda side=side: self._stream_report(side))  # type: ignore[misc]
        diagnostics.add("pairs", self._pairs_report)
        diagnostics.add("cameras", self._cameras_report)
        report_awaited(node, lambda: [health.topic for health in self._health if not health.received], _SOURCES)

    @property
    def paused(self) -> bool:
        """True while nothing is received, since `pause`."""
        return not self._infos

    def pause(self) -> None:
        """Receive nothing until `resume`; images that this node shares with others are received all the same."""
        if self._images is None or self._local:
            self.close()

    def close(self) -> None:
        """End every subscription."""
        for subscription in self._subscriptions:
            self._node.destroy_subscription(subscription)
        self._subscriptions.clear()
        for info in self._infos:
            info.close()
        self._infos.clear()
        for topic, receiver in self._local:
            self._images.remove(topic, receiver)  # type: ignore[union-attr]
        self._local.clear()

    def resume(self) -> None:
        """Receive images again after `pause`."""
        if self.paused:
            self._health = tuple(StreamHealth(health.topic, monotonic()) for health in self._health)
            self.resumed_ns = self._node.get_clock().now().nanoseconds
            self._connect()

    def _subscribe_all(self, qos: QosWatch, message_type: Any, suffix: str, images: LocalImages | None) -> None:
        for side, name in enumerate(SIDES):
            if images is not None and images.offers(self._topics[side]):
                self._local.append((self._topics[side], partial(self._on_local, side)))
                images.receive(*self._local[-1])
            else:
                self._subscribe(qos, message_type, f"{name}/{suffix}", self._on_image, side, IMAGE_QOS)
                if images is not None:
                    images.offer(self._topics[side])
            on_info = partial(self.cameras.on_info, side)
            self._infos.append(CameraInfoInput(self._node, qos, f"{name}/camera_info", on_info))

    def set_parameters(self, stereo: StereoParameters, pairing: PairingParameters) -> None:
        """Use these from the next image on; the transport stays as it is."""
        self._stereo, self._pairing = stereo, pairing
        self._pairer.set_parameters(pairing)

    def _subscribe(
        self, qos: QosWatch, kind: Any, topic: str, callback: Callable[[int, Any], None], side: int, profile: QoSProfile
    ) -> None:
        def receive(message: Any) -> None:
            callback(side, message)

        self._subscriptions.append(qos.create_subscription(kind, topic, receive, profile))

    def _on_local(self, side: int, header: Header, pixels: npt.NDArray[np.uint8]) -> None:
        """Receive an image in the thread that delivers it."""
        self._on_frame(side, ImageFrame(header, pixels, monotonic_ns()), self._age_s(header))

    def _on_frame(self, side: int, frame: ImageFrame, age_s: float) -> None:
        now_ns = frame.arrived_ns
        stamp_ns, size_px = to_nanoseconds(frame.header.stamp), (frame.pixels.shape[1], frame.pixels.shape[0])
        self._health[side].accept(now_ns * 1e-9, age_s, size_px, stamp_ns * 1e-9)
        self._emit(self._pairer.add(side, stamp_ns, frame, now_ns))

    def _on_image(self, side: int, message: Any) -> None:
        now_ns, age_s = monotonic_ns(), self._age_s(message.header)
        if self._is_due is not None and self._images is None:
            stamp_ns = to_nanoseconds(message.header.stamp)
            self._health[side].count(now_ns * 1e-9, age_s, stamp_ns * 1e-9)
            self._emit(self._pairer.add(side, stamp_ns, _Undecoded(message, now_ns), now_ns))
            return
        frame = self._decoded(side, message, now_ns)
        if frame is None:
            return
        with self._lock:
            self._on_frame(side, frame, age_s)
            if self._images is not None:
                self._images.deliver(self._topics[side], frame.header, frame.pixels)

    def _age_s(self, header: Header) -> float:
        return float(self._node.get_clock().now().nanoseconds - to_nanoseconds(header.stamp)) * 1e-9

    def _decoded(self, side: int, message: Any, arrived_ns: int) -> ImageFrame | None:
        health = self._health[side]
        try:
            with self.decode_times.measure("decode"):
                return ImageFrame(message.header, self._to_pixels(message), arrived_ns)
        except ImageError as error:
            health.refuse(monotonic_ns() * 1e-9, str(error))
            self._node.get_logger().warning(f"{health.topic}: {error}", throttle_duration_sec=5.0)
            return None

    def _decoded_pair(self, pair: Pair[Any]) -> ImagePair | None:
        if self._is_due is not None and not self._is_due(pair.left_stamp_ns):
            return None
        if isinstance(pair.left, ImageFrame):
            return pair
        left, right = (
            self._decoded(side, frame.message, frame.arrived_ns) for side, frame in enumerate((pair.left, pair.right))
        )
        if left is None or right is None:
            return None
        for health, frame in zip(self._health, (left, right), strict=True):
            health.decoded((frame.pixels.shape[1], frame.pixels.shape[0]))
        return Pair(left, right, pair.left_stamp_ns, pair.right_stamp_ns)

    def _on_deadline(self) -> None:
        self._deadline.cancel()
        with self._lock:
            self._emit(self._pairer.expire(monotonic_ns()))

    def _emit(self, pairs: list[Pair[Any]]) -> None:
        deadline_ns = self._pairer.deadline_ns
        if deadline_ns is not None:
            self._deadline.timer_period_ns = max(deadline_ns - monotonic_ns(), 1)
            self._deadline.reset()
        if pairs:
            self._read_infos()
        for pair in filter(None, map(self._decoded_pair, pairs)):
            left, right = pair.left.pixels.shape, pair.right.pixels.shape
            if left[:2] != right[:2] and self.cameras.cameras_of(pair) is None:
                self._size_mismatch = (
                    "images of two cameras without calibration must have one size: "
                    f"got {left[1]}x{left[0]} and {right[1]}x{right[0]}"
                )
                self._size_mismatches += 1
                continue
            self._size_mismatch = None
            self._on_pair(pair)

    def _read_infos(self) -> None:
        for info in self._infos:
            info.poll()

    def _cameras_report(self) -> Report:
        with self._lock:
            self._read_infos()
        return self.cameras.report()

    def _stream_report(self, side: int) -> Report:
        health = self._health[side]
        if self.paused:
            return Report(OK, f"{health.topic} is not received: nothing subscribes to what is measured in it")
        local = self._images is not None and self._images.offers(self._topics[side])
        publishers = int(local) or self._node.count_publishers(self._node.resolve_topic_name(health.topic))
        status = health.status(monotonic(), publishers, self._stereo.stalled_after_s)
        late = self._pairer.statistics.late[side]
        return Report(OK if status.ok else ERROR, status.message, status.values | {"out_of_order": late})

    def _pairs_report(self) -> Report:
        counts = self._pairer.statistics
        values: dict[str, object] = {
            "pairs": counts.pairs,
            "unmatched_left": counts.unmatched[LEFT],
            "unmatched_right": counts.unmatched[RIGHT],
            "resets": counts.resets,
            "size_mismatches": self._size_mismatches,
        }
        if counts.skew_median_s is not None and counts.skew_largest_s is not None:
            values["skew_median_ms"] = counts.skew_median_s * 1e3
            values["skew_largest_ms"] = counts.skew_largest_s * 1e3
        if self._size_mismatch is not None:
            return Report(ERROR, self._size_mismatch, values)
        complaint = counts.complaint(self._pairing.slop_s)
        if complaint is not None:
            return Report(ERROR, complaint, values)
        if counts.pairs == 0:
            return Report(WARN, "no pair of images yet", values)
        return Report(OK, f"{counts.pairs} pairs", values)
