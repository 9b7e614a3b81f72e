"""What the camera node's graph tests share: a machine of fake webcams, and frames that arrive on demand."""

import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from sensor_msgs.msg import CameraInfo

from vergence_camera.ros.camera_node import CameraNode
from vergence_camera.testing.fake_camera import FakeCamera
from vergence_camera.testing.fake_machine import FakeMachine
from vergence_common.qos import IMAGE_QOS
from vergence_common.stamps import to_nanoseconds

MS = 1_000_000


def _jpeg(number: int, width: int = 640, height: int = 480) -> bytes:
    x, y = np.meshgrid(np.arange(width) + 5 * number, np.arange(height))
    picture = np.stack([x % 256, y % 256, (x + y) % 256], axis=2).astype(np.uint8)
    return bytes(cv2.imencode(".jpg", picture)[1])


@pytest.fixture(autouse=True)
def ros_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("ROS_HOME", str(tmp_path / "ros"))
    return tmp_path / "ros"


@pytest.fixture
def machine(tmp_path: Path) -> FakeMachine:
    return FakeMachine(tmp_path / "machine")


@pytest.fixture
def start(graph: Any, machine: FakeMachine) -> Callable[..., CameraNode]:
    def make(eye: str = "left", **parameters: Any) -> CameraNode:
        # On a machine that pauses no frame is too old, and silence is no stall.
        patience = {"stall_timeout_s": 60.0, "max_age_s": 60.0, "retry.first_s": 0.02, "retry.longest_s": 0.05}
        values = {"device": "0", **patience, **parameters}
        kind = partial(CameraNode, kernel=machine.kernel, tree=machine.tree, namespace=eye)
        node: CameraNode = graph.start(kind, **values)
        return node

    return make


class Listener:
    """Collects what arrives on one topic."""

    def __init__(self, graph: Any, kind: Any, topic: str) -> None:
        self.messages: list[Any] = []
        self._graph = graph
        self._subscription = graph.client.create_subscription(kind, topic, self.messages.append, IMAGE_QOS)
        graph.wait_until(lambda: graph.client.count_publishers(topic) > 0, f"a publisher of {topic}")

    def wait_for(self, count: int) -> list[Any]:
        self._graph.wait_until(lambda: len(self.messages) >= count, f"{count} messages")
        return self.messages


def _push_until(graph: Any, camera: FakeCamera, condition: Callable[[], bool], what: str) -> None:
    """Let frames arrive, one after the other was taken, until a condition holds."""
    picture = _jpeg(0)

    def pushed() -> bool:
        if len(camera.queued) == 4:
            camera.push(picture)
        return condition()

    graph.wait_until(pushed, what)


def _push_one_by_one(graph: Any, camera: FakeCamera, listener: Listener, pictures: list[bytes]) -> None:
    for picture in pictures:
        wanted = len(listener.messages) + 1
        assert camera.push(picture)
        listener.wait_for(wanted)


def _connected(graph: Any, camera: FakeCamera, listener: Listener) -> None:
    """Push until the first frame arrives, so that discovery is over, then wait for the last one and forget them."""
    _push_until(graph, camera, lambda: bool(listener.messages), "the first frame")
    graph.wait_until(lambda: len(camera.queued) == 4, "all buffers are free")
    time.sleep(0.01)  # the last frame's stamp stands clear of all before it
    last_ns = time.time_ns()
    camera.push(_jpeg(0), time.monotonic_ns())
    graph.wait_until(lambda: to_nanoseconds(listener.messages[-1].header.stamp) > last_ns - MS, "the last frame")
    listener.messages.clear()


def _info_of(graph: Any, camera: FakeCamera) -> CameraInfo:
    listener = Listener(graph, CameraInfo, "/left/camera_info")
    _connected(graph, camera, listener)
    _push_one_by_one(graph, camera, listener, [_jpeg(1)])
    return listener.messages[-1]


@pytest.fixture
def playing() -> Iterator[Callable[..., None]]:
    stops: list[Callable[[], None]] = []

    def play(camera: FakeCamera, rate_hz: float) -> None:
        picture = _jpeg(0)
        stops.append(camera.play(lambda number: picture, rate_hz))

    yield play
    for stop in stops:
        stop()


@pytest.fixture
def jpeg() -> Callable[..., Any]:
    return _jpeg


@pytest.fixture
def push_until() -> Callable[..., Any]:
    return _push_until


@pytest.fixture
def push_one_by_one() -> Callable[..., Any]:
    return _push_one_by_one


@pytest.fixture
def connected() -> Callable[..., Any]:
    return _connected


@pytest.fixture
def info_of() -> Callable[..., Any]:
    return _info_of


@pytest.fixture
def listen(graph: Any) -> Callable[..., Listener]:
    return partial(Listener, graph)
