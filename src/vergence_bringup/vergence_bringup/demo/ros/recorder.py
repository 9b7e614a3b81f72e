"""Listens to the running graph for the demo: states, metrics, truth and pictures, in step with their stamps."""

import threading
import time
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

from vergence_bringup.graph_errors import GraphError
from vergence_common.images import image_to_array
from vergence_common.qos import IMAGE_QOS, STATE_QOS
from vergence_common.stamps import to_nanoseconds
from vergence_msgs.action import LookAt
from vergence_msgs.msg import BoxVergence, EdgeVergence, GazeState, TrueVergence

# A second's: the metrics come after the images, the later the busier the machine.
_KEPT_IMAGES = 30
_CHOOSY_S = 3.0


class Stamped(NamedTuple):
    """A message and when it arrived, in seconds of the node's clock."""

    arrival_s: float
    message: Any


class StereoPicture(NamedTuple):
    """One pair as it was published, with the metrics computed from it."""

    left_bgr: npt.NDArray[np.uint8]
    right_bgr: npt.NDArray[np.uint8]
    edge: EdgeVergence
    box: BoxVergence | None


def _pair_of(message: Any) -> tuple[int, float]:
    """Return what tells a pair of images from every other."""
    return to_nanoseconds(message.header.stamp), message.pair_skew_s


class Recorder:
    """A node in a thread of its own; the demo's main thread waits on what arrives."""

    def __init__(self, domain_id: int | None = None) -> None:
        """Listen in a DDS domain; None for the environment's."""
        if not rclpy.ok():
            rclpy.init(domain_id=domain_id)
        self.node = Node("vergence_demo")
        self._changed = threading.Condition()
        self.states: list[Stamped] = []
        self.edges: list[Stamped] = []
        self.boxes: list[Stamped] = []
        self.truths: list[Stamped] = []
        self.fixations: list[Stamped] = []
        self._images: dict[str, OrderedDict[int, Image]] = {"left": OrderedDict(), "right": OrderedDict()}
        self.node.create_subscription(GazeState, "gaze/state", self._into(self.states), STATE_QOS)
        self.node.create_subscription(EdgeVergence, "vergence/edge", self._into(self.edges), STATE_QOS)
        self.node.create_subscription(BoxVergence, "vergence/box", self._into(self.boxes), STATE_QOS)
        self.node.create_subscription(TrueVergence, "ground_truth/vergence", self._into(self.truths), STATE_QOS)
        self.node.create_subscription(PointStamped, "gaze/fixation_point", self._into(self.fixations), STATE_QOS)
        self._image_subscriptions: list[Any] = []
        self._further: list[Any] = []
        self._look_at = ActionClient(self.node, LookAt, "gaze/look_at")
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)
        self._thread = threading.Thread(target=self._spin, name="demo recorder", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop listening."""
        self._executor.shutdown(timeout_sec=1.0)
        self._thread.join(timeout=2.0)
        self.node.destroy_node()
        rclpy.try_shutdown()

    def listen(self, message_type: type, topic: str, alive: Callable[[], None]) -> list[Stamped]:
        """Record one more topic from now on; returns the list that its messages are appended to."""
        series: list[Stamped] = []
        self._in_executor(
            lambda: self._further.append(
                self.node.create_subscription(message_type, topic, self._into(series), STATE_QOS)
            ),
            alive,
        )
        return series

    def now_s(self) -> float:
        """Return the node's time in seconds."""
        return float(self.node.get_clock().now().nanoseconds) * 1e-9

    def wait_for(self, what: str, condition: Callable[[], Any], timeout_s: float, alive: Callable[[], None]) -> Any:
        """Return the first true value of `condition`, asked after every message.

        `alive` is called meanwhile and raises when a process has died. Raises GraphError after `timeout_s`.
        """
        deadline = time.monotonic() + timeout_s
        while True:
            with self._changed:
                answer = condition()
                if answer:
                    return answer
                left = deadline - time.monotonic()
                if left <= 0:
                    raise GraphError(f"waited {timeout_s:g} s in vain for {what}")
                self._changed.wait(min(left, 0.25))
            alive()

    def settle(self, duration_s: float, alive: Callable[[], None]) -> None:
        """Let the graph run for a while."""
        end = time.monotonic() + duration_s
        while (left := end - time.monotonic()) > 0:
            time.sleep(min(left, 0.25))
            alive()

    def look_at(self, goal: LookAt.Goal, alive: Callable[[], None], timeout_s: float = 30.0) -> LookAt.Result:
        """Send a goal and return its result."""
        self.wait_for("the action gaze/look_at", self._look_at.server_is_ready, 20.0, alive)
        # Both are asked in the executor's own thread: an answer that it takes before the asking thread has noted the
        # question is thrown away by rclpy.
        asked = self._in_executor(lambda: self._look_at.send_goal_async(goal), alive)
        handle = self._future("gaze/look_at to accept a goal", asked, 5.0, alive)
        if not handle.accepted:
            raise GraphError("gaze/look_at refused the goal")
        ending = self._in_executor(handle.get_result_async, alive)
        return self._future("gaze/look_at to end", ending, timeout_s, alive).result

    def set_parameters(self, node_name: str, values: dict[str, Any], alive: Callable[[], None]) -> None:
        """Set parameters of a running node, all at once; raises GraphError with its reason if it refuses."""
        client = AsyncParameterClient(self.node, node_name)
        self.wait_for(f"the parameters of {node_name}", client.services_are_ready, 20.0, alive)
        request = [Parameter(name, value=value) for name, value in values.items()]
        answer = self._future(f"{node_name} to take parameters", client.set_parameters_atomically(request), 5.0, alive)
        if not answer.result.successful:
            raise GraphError(f"{node_name} refused {values}: {answer.result.reason}")

    def picture(self, with_boxes: bool, alive: Callable[[], None], timeout_s: float = 20.0) -> StereoPicture:
        """Return the next pair of images together with the metrics that the graph computed from that very pair.

        The boxes come a few times a second and a busy machine leaves pairs out: where none is of that very pair for a
        while, the newest ones are taken. Call it while nothing moves.
        """
        for images in self._images.values():
            images.clear()
        first_box, choosy_until_s = len(self.boxes), time.monotonic() + _CHOOSY_S
        self._in_executor(self._subscribe_to_images, alive)

        def matched() -> tuple[Image, Image, EdgeVergence, BoxVergence | None] | None:
            boxes = {_pair_of(entry.message): entry.message for entry in self.boxes[first_box:]}
            for left, right, edge in self._edge_pairs():
                box = boxes.get(_pair_of(edge))
                if box is None and boxes and time.monotonic() > choosy_until_s:
                    box = self.boxes[-1].message
                if box is not None or not with_boxes:
                    return left, right, edge, box
            return None

        what = "a pair of images and its metrics" if with_boxes else "a pair of images and its metric"
        try:
            left, right, edge, box = self.wait_for(what, matched, timeout_s, alive)
        finally:
            self._in_executor(self._unsubscribe_from_images, alive)
        return StereoPicture(image_to_array(left).copy(), image_to_array(right).copy(), edge, box)

    def _in_executor(self, work: Callable[[], Any], alive: Callable[[], None]) -> Any:
        # Entities must not come and go under the executor while it waits for them.
        return self._future("the recorder's own thread", self._executor.create_task(work), 5.0, alive)

    def _subscribe_to_images(self) -> None:
        self._image_subscriptions = [
            self.node.create_subscription(Image, f"{eye}/image_raw", self._keep(eye), IMAGE_QOS) for eye in self._images
        ]

    def _unsubscribe_from_images(self) -> None:
        for subscription in self._image_subscriptions:
            self.node.destroy_subscription(subscription)
        self._image_subscriptions = []

    def _edge_pairs(self) -> Iterator[tuple[Image, Image, EdgeVergence]]:
        """Give the pairs of images of which the edge metric is known, newest first."""
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

    def _keep(self, eye: str) -> Callable[[Image], None]:
        def keep(message: Image) -> None:
            with self._changed:
                images = self._images[eye]
                images[to_nanoseconds(message.header.stamp)] = message
                while len(images) > _KEPT_IMAGES:
                    images.popitem(last=False)
                self._changed.notify_all()

        return keep

    def _into(self, series: list[Stamped]) -> Callable[[Any], None]:
        def append(message: Any) -> None:
            with self._changed:
                series.append(Stamped(self.now_s(), message))
                self._changed.notify_all()

        return append

    def _future(self, what: str, future: Any, timeout_s: float, alive: Callable[[], None]) -> Any:
        self.wait_for(what, future.done, timeout_s, alive)
        return future.result()

    def _spin(self) -> None:
        try:
            self._executor.spin()
        except (ExternalShutdownException, KeyboardInterrupt):
            return
