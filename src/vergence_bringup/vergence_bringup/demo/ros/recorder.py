"""Records the running graph for the demo: states, metrics, ground truth, and image pairs with their metrics."""

import threading
from collections import OrderedDict
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import rclpy
from geometry_msgs.msg import PointStamped
from rclpy.action import ActionClient
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from sensor_msgs.msg import Image

from vergence_bringup.demo.ros.timeline import Check, RealTime, SteppedTime, Timeline
from vergence_bringup.graph_errors import GraphError
from vergence_common.goal_requests import request_goal, request_result
from vergence_common.images import image_to_array
from vergence_common.qos import IMAGE_QOS, STATE_QOS
from vergence_common.stamps import to_nanoseconds
from vergence_common.start import init
from vergence_msgs.action import LookAt
from vergence_msgs.msg import BoxVergence, EdgeVergence, GazeState, TrueVergence

# One second: metrics arrive after their images, later on a busy machine.
_KEPT_IMAGES = 30
_SAME_PAIR_S = 3.0


class Stamped(NamedTuple):
    """A message and its arrival in seconds of the node's clock."""

    arrival_s: float
    message: Any


class StereoPicture(NamedTuple):
    """One published pair with the metrics computed from it."""

    left_bgr: npt.NDArray[np.uint8]
    right_bgr: npt.NDArray[np.uint8]
    edge: EdgeVergence
    box: BoxVergence | None


def _pair_key(message: Any) -> tuple[int, float]:
    """Return the key of a pair: the left stamp [ns] and the skew [s]."""
    return to_nanoseconds(message.header.stamp), message.pair_skew_s


class Recorder:
    """A node in a thread of its own; the main thread waits for its messages."""

    def __init__(self, domain_id: int | None = None, stepped: bool = False) -> None:
        """Subscribe in a DDS domain, None for the environment's; `stepped` steps the simulator's time."""
        if not rclpy.ok():
            init(domain_id=domain_id)
        self.node = Node("vergence_demo")
        self._changed = threading.Condition()
        self.time: Timeline
        self.states: list[Stamped] = []
        self.edges: list[Stamped] = []
        self.boxes: list[Stamped] = []
        self.truths: list[Stamped] = []
        self.fixations: list[Stamped] = []
        self._images: dict[str, OrderedDict[int, Image]] = {"left": OrderedDict(), "right": OrderedDict()}
        self.node.create_subscription(GazeState, "gaze/state", self._append_to(self.states), STATE_QOS)
        self.node.create_subscription(EdgeVergence, "vergence/edge", self._append_to(self.edges), STATE_QOS)
        self.node.create_subscription(BoxVergence, "vergence/box", self._append_to(self.boxes), STATE_QOS)
        self.node.create_subscription(TrueVergence, "ground_truth/vergence", self._append_to(self.truths), STATE_QOS)
        self.node.create_subscription(PointStamped, "gaze/fixation_point", self._append_to(self.fixations), STATE_QOS)
        self._image_subscriptions: list[Any] = []
        self._further: list[Any] = []
        self._look_at = ActionClient(self.node, LookAt, "gaze/look_at")
        # Where time is stepped, images of every pair are here, at whatever step their discovery would have ended.
        self._always_images = stepped
        if stepped:
            self._subscribe_to_images()
        # After the subscriptions: what was sent before the simulator stood is then here.
        self.time = SteppedTime(self.node, self._changed) if stepped else RealTime(self.node, self._changed)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)
        self._thread = threading.Thread(target=self._spin, name="demo recorder", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop recording."""
        self._executor.shutdown(timeout_sec=1.0)
        self._thread.join(timeout=2.0)
        self.node.destroy_node()
        rclpy.try_shutdown()

    def record(self, message_type: type, topic: str, check_alive: Check) -> list[Stamped]:
        """Record one more topic from now on; return the list to which its messages are appended."""
        series: list[Stamped] = []
        self._in_executor(
            lambda: self._further.append(
                self.node.create_subscription(message_type, topic, self._append_to(series), STATE_QOS)
            ),
            check_alive,
        )
        return series

    def now_s(self) -> float:
        """Return the time in seconds."""
        return self.time.now_s()

    def wait_for(self, what: str, condition: Callable[[], Any], timeout_s: float, check_alive: Check) -> Any:
        """Return the first true value of `condition`, for which time passes.

        `check_alive` is called meanwhile and raises when a process has ended. Raises GraphError after `timeout_s`.
        """
        return self.time.wait_for(what, condition, timeout_s, check_alive)

    def settle(self, duration_s: float, check_alive: Check) -> None:
        """Let the graph run for a while."""
        self.time.settle(duration_s, check_alive)

    def look_at(self, goal: LookAt.Goal, check_alive: Check, timeout_s: float = 30.0) -> LookAt.Result:
        """Send a goal and return its result."""
        self.time.wait_for_answer("the action gaze/look_at", self._look_at.server_is_ready, 20.0, check_alive)
        # Requests are sent in the executor's thread: rclpy discards a response that arrives before the sending thread
        # has registered the request.
        sent = self._in_executor(lambda: request_goal(self.node, self._look_at, goal), check_alive)
        handle = self._future("gaze/look_at to accept a goal", sent, 20.0, check_alive)
        if not handle.accepted:
            raise GraphError("gaze/look_at refused the goal")
        began_s = self.now_s()
        ended = self._in_executor(lambda: request_result(self.node, handle), check_alive)
        self.wait_for("gaze/look_at to end", ended.done, timeout_s, check_alive)
        result = ended.result().result
        self.time.settle_after_goal(began_s + result.time_s, check_alive)
        return result

    def set_parameters(self, node_name: str, values: dict[str, Any], check_alive: Check) -> None:
        """Set parameters of a running node, all at once; raises GraphError with the reason if it refuses."""
        client = AsyncParameterClient(self.node, node_name)
        self.time.wait_for_answer(f"the parameters of {node_name}", client.services_are_ready, 20.0, check_alive)
        request = [Parameter(name, value=value) for name, value in values.items()]
        answer = self._future(
            f"{node_name} to set parameters", client.set_parameters_atomically(request), 5.0, check_alive
        )
        if not answer.result.successful:
            raise GraphError(f"{node_name} refused {values}: {answer.result.reason}")

    def picture(self, with_boxes: bool, check_alive: Check, timeout_s: float = 20.0) -> StereoPicture:
        """Return the next pair of images with the metrics that the graph computed from the same pair.

        Boxes arrive a few times a second, and a busy machine skips pairs: after a while the newest boxes are used. Call
        it while nothing moves.
        """
        for images in self._images.values():
            images.clear()
        first_box, same_pair_until_s = len(self.boxes), self.now_s() + _SAME_PAIR_S
        if not self._always_images:
            self._in_executor(self._subscribe_to_images, check_alive)

        def matched() -> tuple[Image, Image, EdgeVergence, BoxVergence | None] | None:
            arrived = self.boxes[first_box:] if with_boxes else ()
            boxes = {_pair_key(entry.message): entry.message for entry in arrived}
            for left, right, edge in self._edge_pairs():
                box = boxes.get(_pair_key(edge))
                if box is None and boxes and self.now_s() > same_pair_until_s:
                    box = self.boxes[-1].message
                if box is not None or not with_boxes:
                    return left, right, edge, box
            return None

        what = "a pair of images and its metrics" if with_boxes else "a pair of images and its metric"
        try:
            left, right, edge, box = self.wait_for(what, matched, timeout_s, check_alive)
        finally:
            if not self._always_images:
                self._in_executor(self._unsubscribe_from_images, check_alive)
        return StereoPicture(image_to_array(left).copy(), image_to_array(right).copy(), edge, box)

    def _in_executor(self, work: Callable[[], Any], check_alive: Check) -> Any:
        # Entities must not be created or destroyed while the executor waits on them.
        return self._future("the recorder's own thread", self._executor.create_task(work), 5.0, check_alive)

    def _subscribe_to_images(self) -> None:
        self._image_subscriptions = [
            self.node.create_subscription(Image, f"{eye}/image_raw", self._store_images(eye), IMAGE_QOS)
            for eye in self._images
        ]

    def _unsubscribe_from_images(self) -> None:
        for subscription in self._image_subscriptions:
            self.node.destroy_subscription(subscription)
        self._image_subscriptions = []

    def _edge_pairs(self) -> Iterator[tuple[Image, Image, EdgeVergence]]:
        """Yield the pairs of images whose edge metric has arrived, newest first."""
        for entry in reversed(self.edges[-_KEPT_IMAGES:]):
            edge = entry.message
            left_ns = to_nanoseconds(edge.header.stamp)
            left = self._images["left"].get(left_ns)
            if left is None:
                continue
            right_ns = left_ns + round(edge.pair_skew_s * 1e9)
            for stamp, right in self._images["right"].items():
                if abs(stamp - right_ns) < 1_000_000:
                    yield left, right, edge

    def _store_images(self, eye: str) -> Callable[[Image], None]:
        def store(message: Image) -> None:
            with self._changed:
                images = self._images[eye]
                images[to_nanoseconds(message.header.stamp)] = message
                while len(images) > _KEPT_IMAGES:
                    images.popitem(last=False)
                self._changed.notify_all()

        return store

    def _append_to(self, series: list[Stamped]) -> Callable[[Any], None]:
        def append(message: Any) -> None:
            with self._changed:
                series.append(Stamped(self.now_s(), message))
                self._changed.notify_all()

        return append

    def _future(self, what: str, future: Any, timeout_s: float, check_alive: Check) -> Any:
        self.time.wait_for_answer(what, future.done, timeout_s, check_alive)
        return future.result()

    def _spin(self) -> None:
        try:
            self._executor.spin()
        except (ExternalShutdownException, KeyboardInterrupt):
            return
