"""What web_node receives while a page is open, and the parts that it makes of it.

Messages stay serialised until they are shown: most are never looked at, and JPEGs are passed on as they are.
"""

import json
import math
import time
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import deserialize_message
from rclpy.subscription import Subscription
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, JointState

from vergence_common.images import image_to_array
from vergence_common.qos import IMAGE_QOS, STATE_QOS, QosWatch
from vergence_common.stamps import STAMP_END, stamp_of_serialised
from vergence_msgs.msg import (
    BoxVergence,
    DetectorClasses,
    EdgeVergence,
    GazeState,
    StereoDetections,
    TargetTrack,
    VergenceError,
)
from vergence_rig.camera import CameraModel, CameraModelError
from vergence_rig.rig import Rig
from vergence_rig.stream import Stream
from vergence_web.eye_marks import EyeMarks
from vergence_web.eye_pair import EyeFrame, EyePair
from vergence_web.health import Health
from vergence_web.jpeg import jpeg_of
from vergence_web.page_state import Newest, PageState, figure
from vergence_web.parameters import WebNodeParameters
from vergence_web.update import Part

EYES = ("left", "right")
_LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
_STATES: dict[str, tuple[Any, QoSProfile]] = {
    "gaze/state": (GazeState, STATE_QOS),
    "joint_states": (JointState, STATE_QOS),
    "joint_command": (JointState, STATE_QOS),
    "vergence/edge": (EdgeVergence, STATE_QOS),
    "vergence/error": (VergenceError, STATE_QOS),
    "vergence/track": (TargetTrack, STATE_QOS),
    "vergence/box": (BoxVergence, STATE_QOS),
    "vergence/detections": (StereoDetections, STATE_QOS),
    "vergence/detector_classes": (DetectorClasses, _LATCHED),
    "left/camera_info": (CameraInfo, STATE_QOS),
    "right/camera_info": (CameraInfo, STATE_QOS),
}
_NOT_RATED = ("vergence/detector_classes",)
_LONE_S = 0.15
_AGE_EVERY_S = 0.3
_EDGES_PERIOD_S = 0.15
_LOOK_S = 1.0

Post = Callable[[Mapping[str, Part]], None]


class GraphInput:
    """Subscribes the graph between `start` and `stop`; `post` is called with the parts for the pages.

    `wanted` says whether any page can be sent something now.
    """

    def __init__(
        self,
        node: Node,
        rig: Rig,
        parameters: Callable[[], WebNodeParameters],
        qos: QosWatch,
        post: Post,
        wanted: Callable[[], bool],
    ) -> None:
        self._node, self._parameters, self._qos, self._post, self._wanted = node, parameters, qos, post, wanted
        self._rig, self._state = rig, PageState(rig)
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._subscriptions: dict[str, Subscription] = {}
        self._timers: list[Any] = []
        self._forget()

    def _forget(self) -> None:
        self._streams = {topic: Stream() for topic in (*_STATES, "left/image", "right/image")}
        self._ages_s, self._aged_s = dict[str, float](), dict[str, float]()
        self._decoded: dict[str, tuple[int, Any]] = {}
        self._pair, self._marks, self._health = EyePair(), EyeMarks(self._rig), Health()
        self._infos: dict[str, bytes] = {}
        self._transports: dict[str, str] = {}
        self._edges_s = -math.inf
        self._refused = ""

    @property
    def running(self) -> bool:
        """True while the graph is received."""
        return bool(self._timers)

    def start(self) -> None:
        """Receive the graph."""
        if self.running:
            return
        self._forget()
        for topic, (kind, profile) in _STATES.items():
            self._subscribe(topic, kind, topic, partial(self._on_state, topic), profile)
        self._subscribe("diagnostics", DiagnosticArray, "/diagnostics", self._on_diagnostics, STATE_QOS)
        self._look()
        period_s = 1.0 / self._parameters().state_rate_hz
        self._timers = [
            self._node.create_timer(period_s, self._tick, clock=self._steady),
            self._node.create_timer(_LOOK_S, self._look, clock=self._steady),
        ]

    def stop(self) -> None:
        """Receive nothing."""
        for timer in self._timers:
            self._node.destroy_timer(timer)
        self._timers = []
        for key in list(self._subscriptions):
            self._unsubscribe(key)

    def show_edges(self, wanted: bool) -> None:
        """Receive the metric's picture of the combined edges, or no longer."""
        if wanted and self.running and "edges" not in self._subscriptions:
            self._subscribe("edges", Image, "vergence/overlay", self._on_edges, IMAGE_QOS)
        elif not wanted:
            self._unsubscribe("edges")

    def _subscribe(
        self, key: str, kind: Any, topic: str, callback: Callable[[bytes], None], profile: QoSProfile
    ) -> None:
        self._subscriptions[key] = self._qos.create_subscription(kind, topic, callback, profile, serialised=True)

    def _unsubscribe(self, key: str) -> None:
        subscription = self._subscriptions.pop(key, None)
        if subscription is not None:
            self._node.destroy_subscription(subscription)

    def _look(self) -> None:
        """Choose the transport of each eye's images, and report what changes once a second."""
        for eye in EYES:
            transport = self._transport(eye)
            if self._transports.get(eye) != transport:
                self._transports[eye] = transport
                self._unsubscribe(f"{eye}/image")
                jpeg = transport == "compressed"
                kind, suffix = (CompressedImage, "image_raw/compressed") if jpeg else (Image, "image_raw")
                receive = partial(self._on_image, eye)
                self._subscribe(f"{eye}/image", kind, f"{eye}/{suffix}", receive, IMAGE_QOS)
        if self._timers and self._wanted():
            self._post({"slow": Part(json.dumps(self._slow(), allow_nan=False))})

    def _transport(self, eye: str) -> str:
        chosen = self._parameters().image_transport
        if chosen != "auto":
            return chosen
        compressed = self._node.resolve_topic_name(f"{eye}/image_raw/compressed")
        present = self._transports.get(eye, "compressed")
        if self._node.count_publishers(compressed):
            return "compressed"
        return "raw" if self._node.count_publishers(self._node.resolve_topic_name(f"{eye}/image_raw")) else present

    def _on_state(self, topic: str, message: bytes) -> None:
        self._note(topic, message)

    def _note(self, topic: str, message: bytes) -> int:
        """Count a message; return its stamp [ns]."""
        now_s, stamp_ns, stream = time.monotonic(), stamp_of_serialised(message), self._streams[topic]
        stream.add(message, now_s)
        if now_s - self._aged_s.get(topic, -math.inf) > _AGE_EVERY_S:
            self._aged_s[topic] = now_s
            self._ages_s[topic] = (self._node.get_clock().now().nanoseconds - stamp_ns) * 1e-9
        return stamp_ns

    def _on_image(self, eye: str, message: bytes) -> None:
        frame = EyeFrame(message, self._note(f"{eye}/image", message))
        if self._wanted():
            self._send_images(self._pair.add(eye, frame, time.monotonic(), self._parameters().image_rate_hz))

    def _send_images(self, frames: Mapping[str, EyeFrame]) -> None:
        parts = {}
        for eye, frame in frames.items():
            try:
                data = self._jpeg(self._transports[eye], frame.message)
            except ValueError as error:
                self._refused = f"{eye}: {error}"
                continue
            parts[eye] = Part(data=data, about={"stamp": str(frame.stamp_ns)})
        if parts:
            self._post(parts)

    def _jpeg(self, transport: str, message: bytes) -> bytes:
        if transport == "compressed":
            return deserialize_message(message, CompressedImage).data.tobytes()
        return jpeg_of(image_to_array(deserialize_message(message, Image)), self._parameters().jpeg_quality)

    def _on_edges(self, message: bytes) -> None:
        now_s = time.monotonic()
        if now_s - self._edges_s < _EDGES_PERIOD_S or not self._wanted():
            return
        self._edges_s = now_s
        try:
            data = self._jpeg("raw", message)
        except ValueError as error:
            self._refused = f"edges: {error}"
            return
        self._post({"edges": Part(data=data, about={"stamp": str(stamp_of_serialised(message))})})

    def _on_diagnostics(self, message: bytes) -> None:
        now_s = time.monotonic()
        for status in deserialize_message(message, DiagnosticArray).status:
            values = {value.key: value.value for value in status.values}
            self._health.add(status.name, status.level[0], status.message, values, now_s)

    def _tick(self) -> None:
        """Send the state."""
        now_s = time.monotonic()
        if not self._wanted():
            return
        self._send_images(self._pair.lone(now_s, _LONE_S))
        try:
            self._send_state(now_s)
        except Exception as error:  # whatever is received must not end the node that only shows it
            text = f"the state cannot be shown: {type(error).__name__}: {error}"
            self._node.get_logger().error(text, throttle_duration_sec=10.0)

    def _send_state(self, now_s: float) -> None:
        self._update_cameras()
        state = self._state.build(self._messages(now_s))
        windows = state["edge"]["windows_px"] if state["edge"] else []
        state["eyes"] = self._marks.marks(windows)
        self._post({"state": Part(json.dumps(state, allow_nan=False))})

    def _messages(self, now_s: float) -> dict[str, Newest]:
        """Return the newest message of each topic; one that was decoded before is not decoded again."""
        found = {}
        for topic, (kind, _) in _STATES.items():
            stream = self._streams[topic]
            if not stream.count or topic.endswith("camera_info"):
                continue
            count, message = self._decoded.get(topic, (0, None))
            if count != stream.count:
                message = deserialize_message(stream.message, kind)
                self._decoded[topic] = (stream.count, message)
            found[topic] = Newest(message, now_s - stream.arrived_s)
        return found

    def _update_cameras(self) -> None:
        for eye in EYES:
            raw = self._streams[f"{eye}/camera_info"].message
            # All but the stamp: it comes with every image and seldom changes.
            if raw is None or self._infos.get(eye) == raw[STAMP_END:]:
                continue
            self._infos[eye] = raw[STAMP_END:]
            info = deserialize_message(raw, CameraInfo)
            try:
                model: CameraModel | None = CameraModel.from_camera_info_values(
                    info.width, info.height, tuple(info.k), tuple(info.d), info.distortion_model
                )
            except CameraModelError:
                model = None  # the metric nodes' diagnostics say why
            self._marks.set_camera(eye == "left", model, info.width, info.height)

    def _slow(self) -> dict[str, Any]:
        """Return what changes slowly: rates, diagnostics, the detector's classes."""
        now_s = time.monotonic()
        rates = [
            {
                "topic": topic,
                "rate_hz": figure(stream.rate_hz(now_s), 1),
                "age_s": figure(now_s - stream.arrived_s, 2),
                "latency_s": figure(self._ages_s.get(topic, math.nan), 4),
            }
            for topic, stream in self._streams.items()
            if topic not in _NOT_RATED
        ]
        classes = self._messages(now_s).get("vergence/detector_classes")
        return {
            "rates": rates,
            "transports": self._transports,
            "refused": self._refused,
            "diagnostics": self._health.as_values(now_s),
            "classes": [str(name)[:100] for name in classes.message.names[:100]] if classes else None,
        }
