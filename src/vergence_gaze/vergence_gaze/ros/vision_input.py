"""The subscriptions of what is measured in the images: held only while the controller turns the eyes by it.

Without them the metric nodes measure nothing, and after a while receive no images.
"""

import math
from collections.abc import Callable
from typing import Any

from rclpy.node import Node

from vergence_common.polled_subscription import PolledSubscription
from vergence_common.qos import QosWatch
from vergence_gaze.estimation.observations import Observation
from vergence_gaze.ros import gaze_messages as convert
from vergence_msgs.msg import BoxVergence, EdgeVergence, EyeRotation, TargetTrack
from vergence_rig.eye_image import EyeImage

_UNUSED_S = 5.0  # between two goals the subscriptions stay


class VisionInput:
    """Passes tracks, contrasts, boxes and eye rotations to `add`, when it is polled.

    `left_image` returns the left camera's image model.

    In simulated time the subscriptions stay: the clock waits for the measurements, in the order of the subscribers.
    """

    def __init__(
        self, node: Node, watch: QosWatch, add: Callable[[Observation], None], left_image: Callable[[], EyeImage]
    ) -> None:
        self._node, self._watch, self._add, self._left_image = node, watch, add, left_image
        self._reads_edges = False
        self._stays = bool(node.get_parameter("use_sim_time").value)
        self._used_s = math.nan
        self._subscriptions: list[PolledSubscription] = []
        self._subscribe()

    def poll(self) -> None:
        """Pass on what has arrived."""
        for subscription in tuple(self._subscriptions):
            subscription.poll()

    def close(self) -> None:
        """Receive nothing more."""
        for subscription in self._subscriptions:
            subscription.close()
        self._subscriptions.clear()

    def update(self, used: bool, now_s: float) -> None:
        """Subscribe while the measurements are used, and for some seconds after; `now_s` is of a steady clock."""
        if used or math.isnan(self._used_s):
            self._used_s = now_s
        if used and not self._subscriptions:
            self._subscribe()
        elif self._subscriptions and now_s - self._used_s > _UNUSED_S and not self._stays:
            self.close()

    def _subscribe(self) -> None:
        self._read(TargetTrack, "vergence/track", self._on_track)
        self._read(BoxVergence, "vergence/box", lambda m: self._add(convert.box_sighting(m, self._left_image().fx_px)))
        self._read(EyeRotation, "vergence/eye_rotation", lambda m: self._add(convert.eye_rotation(m)))
        if self._reads_edges:
            self._subscribe_edges()

    def _subscribe_edges(self) -> None:
        self._read(EdgeVergence, "vergence/edge", lambda m: self._add(convert.edge_contrast(m)))

    def _read(self, message_type: Any, topic: str, on_message: Callable[[Any], None]) -> None:
        self._subscriptions.append(PolledSubscription(self._node, self._watch, message_type, topic, on_message))

    def _on_track(self, message: TargetTrack) -> None:
        if message.contrast_window_px:
            self._add(convert.track_contrast(message))
        elif not self._reads_edges and message.status != TargetTrack.STATUS_UNUSABLE_IMAGES:
            # Another tracker says nothing of contrast: vergence/edge does, and costs both sides more.
            self._reads_edges = True
            self._subscribe_edges()
        self._add(convert.track_sighting(message, self._left_image()))
