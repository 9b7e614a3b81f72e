"""Collects views of the calibration board from the running cameras while the user moves it."""

import argparse
import sys
from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import CompressedImage, Image

from vergence_camera.calibration.boards import BoardError, Detection
from vergence_camera.calibration.views import EYES, View, ViewCollector
from vergence_common.images import ImageError, compressed_to_array, image_to_array
from vergence_common.qos import IMAGE_QOS
from vergence_common.stamps import to_seconds
from vergence_common.start import init

Picture = npt.NDArray[np.uint8]

_STEADY_PX = 1.5
_SILENCE_S = 5.0


class LiveViews(Node):
    """Offers every pair of images to a collector and keeps those in which the board is still."""

    def __init__(
        self,
        collector: ViewCollector,
        topics: dict[str, str],
        wanted: int,
        max_skew_s: float,
        say: Callable[[str], None],
        **node_options: Any,
    ) -> None:
        super().__init__("calibrate_cameras", **node_options)
        self._collector, self._wanted, self._max_skew_s, self._say = collector, wanted, max_skew_s, say
        self._newest: dict[str, tuple[float, Picture]] = {}
        self._previous: dict[str, Detection] = {}
        self._eyes, self._offered, self._received = tuple(topics), 0, Counter[str]()
        self.done = rclpy.task.Future()
        for eye, topic in topics.items():
            kind = CompressedImage if topic.endswith("/compressed") else Image
            self.create_subscription(kind, topic, lambda message, eye=eye: self._on_image(eye, message), IMAGE_QOS)
        self._topics = topics
        self.create_timer(_SILENCE_S, self._report_silence)

    def _on_image(self, eye: str, message: Image | CompressedImage) -> None:
        try:
            is_jpeg = isinstance(message, CompressedImage)
            picture = compressed_to_array(message) if is_jpeg else image_to_array(message)
        except ImageError as error:
            self._say(f"{eye}: {error}")
            return
        self._received[eye] += 1
        self._newest[eye] = (to_seconds(message.header.stamp), picture)
        if len(self._newest) < len(self._eyes) or self.done.done():
            return
        stamps = [stamp for stamp, _ in self._newest.values()]
        if max(stamps) - min(stamps) > self._max_skew_s:
            return
        pictures = {eye: picture for eye, (_, picture) in self._newest.items()}
        self._newest.clear()
        self._offer(pictures)

    def _offer(self, pictures: dict[str, Picture]) -> None:
        self._offered += 1
        verdict = self._collector.offer(f"view {self._offered}", pictures, self._is_steady)
        if not verdict.accepted:
            # A live stream has hundreds of unusable images: only accepted views are printed.
            self._collector.verdicts.pop()
            return
        parts = [f"{eye} {self._collector.coverage(eye).fraction:.0%}" for eye in self._eyes]
        advice = {text for eye in self._eyes for text in self._collector.coverage(eye).advice()}
        self._say(
            f"[{len(self._collector.views)}/{self._wanted}] view accepted; covered: {', '.join(parts)}"
            + (f"; now {'; '.join(sorted(advice))}" if advice else "")
        )
        if len(self._collector.views) >= self._wanted:
            self.done.set_result(None)

    def _is_steady(self, view: View) -> bool:
        previous, self._previous = self._previous, view.corners
        moved = []
        for eye, detection in view.corners.items():
            if eye not in previous:
                return False
            common = np.intersect1d(detection.ids, previous[eye].ids)
            if not len(common):
                return False
            shift = detection.only(common).points_px - previous[eye].only(common).points_px
            moved.append(float(np.linalg.norm(shift, axis=1).mean()))
        return max(moved) < _STEADY_PX

    def _report_silence(self) -> None:
        silent = [topic for eye, topic in self._topics.items() if not self._received[eye]]
        if silent:
            self._say(f"no message on {', '.join(silent)}: check that the camera nodes run")
        self._received.clear()


def collect_live(collector: ViewCollector, args: argparse.Namespace, say: Callable[[str], None]) -> ViewCollector:
    """Collect views until there are enough or the user ends it; raises BoardError if there is none."""
    eyes = EYES if args.eyes == "both" else (args.eyes,)
    topics = {eye: topic for eye, topic in zip(EYES, args.topics, strict=True) if eye in eyes}
    init([])
    try:
        node = LiveViews(collector, topics, args.views, args.max_skew_s, say)
        say("move the board through the whole image, near and far, tilted; hold it still for a moment each time")
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        try:
            executor.spin_until_future_complete(node.done)
        except (KeyboardInterrupt, ExternalShutdownException):
            print(file=sys.stderr)
        node.destroy_node()
    finally:
        rclpy.try_shutdown()
    if not collector.views:
        raise BoardError("no view was accepted: the board must be completely visible and held still")
    return collector
