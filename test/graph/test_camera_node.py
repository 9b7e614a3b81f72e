"""camera_node in one process with cameras that the test plugs in and out."""

import itertools
import math
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from rcl_interfaces.srv import DescribeParameters
from rclpy.parameter import Parameter
from rclpy.serialization import deserialize_message, serialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from sensor_msgs.srv import SetCameraInfo
from std_msgs.msg import Header

from vergence_camera.camera_info import Calibration, load_calibration, save_calibration
from vergence_camera.camera_messages import JpegSerializer
from vergence_camera.camera_node import CameraNode
from vergence_camera.errors import ControlError, FileMissingError, ModeMismatchError
from vergence_camera.fake_machine import FakeMachine
from vergence_camera.v4l2 import structures as v4l2
from vergence_camera.v4l2.fake_camera import FakeCamera
from vergence_common.images import image_to_array
from vergence_common.qos import IMAGE_QOS
from vergence_common.stamps import from_nanoseconds, to_nanoseconds
from vergence_rig.parameters import ParameterError

pytestmark = pytest.mark.graph

MS = 1_000_000
K = (533.0, 0.0, 339.0, 0.0, 534.0, 234.0, 0.0, 0.0, 1.0)


def jpeg(number: int, width: int = 640, height: int = 480) -> bytes:
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
        patience = {"stall_timeout_s": 60.0, "max_age_s": 60.0, "first_retry_s": 0.02, "last_retry_s": 0.05}
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
        graph.wait_until(lambda: graph.client.count_publishers(topic) > 0, f"somebody publishes {topic}")

    def wait_for(self, count: int) -> list[Any]:
        self._graph.wait_until(lambda: len(self.messages) >= count, f"{count} messages")
        return self.messages


def push_until(graph: Any, camera: FakeCamera, condition: Callable[[], bool], what: str, data: bytes = b"") -> None:
    """Let frames arrive, one after the other was taken, until a condition holds."""
    data = data or jpeg(0)
    numbers = itertools.count()

    def pushed() -> bool:
        next(numbers)
        if len(camera.queued) == 4:
            camera.push(data)
        return condition()

    graph.wait_until(pushed, what)


def push_one_by_one(graph: Any, camera: FakeCamera, listener: Listener, pictures: list[bytes]) -> None:
    for picture in pictures:
        wanted = len(listener.messages) + 1
        assert camera.push(picture)
        listener.wait_for(wanted)


def connected(graph: Any, camera: FakeCamera, listener: Listener) -> None:
    """Push until the first frame arrives, so that discovery is over, then wait for the last one and forget them."""
    push_until(graph, camera, lambda: bool(listener.messages), "the first frame")
    graph.wait_until(lambda: len(camera.queued) == 4, "all buffers are free")
    time.sleep(0.01)  # the last frame's stamp stands clear of all before it
    last_ns = time.time_ns()
    camera.push(jpeg(0), time.monotonic_ns())
    graph.wait_until(lambda: to_nanoseconds(listener.messages[-1].header.stamp) > last_ns - MS, "the last frame")
    listener.messages.clear()


def test_each_jpeg_goes_out_untouched_once_with_the_kernels_stamp(
    graph: Any, machine: FakeMachine, start: Callable[..., CameraNode]
) -> None:
    camera = machine.plug_in(0, serial="AAA")
    start()
    listener = Listener(graph, CompressedImage, "/left/image_raw/compressed")
    connected(graph, camera, listener)
    pictures = [jpeg(number) for number in range(8)]
    captured_ns = []
    time.sleep(0.2)  # the oldest of them is captured after the last frame above
    for number, picture in enumerate(pictures):
        age_ns = 20 * MS * (len(pictures) - number)
        before_ns, monotonic_ns, after_ns = time.time_ns(), time.monotonic_ns(), time.time_ns()
        captured_ns.append((before_ns - age_ns, after_ns - age_ns))
        camera.push(picture, monotonic_ns - age_ns)
        listener.wait_for(number + 1)
    graph.executor.spin_once(timeout_sec=0.2)
    assert [bytes(message.data) for message in listener.messages] == pictures
    stamps = [to_nanoseconds(message.header.stamp) for message in listener.messages]
    assert all(before < after for before, after in itertools.pairwise(stamps))
    for stamp, (earliest_ns, latest_ns) in zip(stamps, captured_ns, strict=True):
        assert earliest_ns - 15 * MS < stamp < latest_ns + 15 * MS
    assert {message.header.frame_id for message in listener.messages} == {"left_camera_optical_frame"}
    assert {message.format for message in listener.messages} == {"jpeg"}


def test_pixels_only_for_those_who_listen(
    graph: Any, machine: FakeMachine, start: Callable[..., CameraNode], monkeypatch: pytest.MonkeyPatch
) -> None:
    decoded: list[int] = []
    decode = cv2.imdecode

    def counted(*arguments: Any) -> Any:
        decoded.append(1)
        return decode(*arguments)

    monkeypatch.setattr("vergence_camera.pixels.cv2.imdecode", counted)
    camera = machine.plug_in(0)
    start()
    packed = Listener(graph, CompressedImage, "/left/image_raw/compressed")
    connected(graph, camera, packed)
    push_one_by_one(graph, camera, packed, [jpeg(n) for n in range(3)])
    assert decoded == []
    raw = Listener(graph, Image, "/left/image_raw")
    connected(graph, camera, raw)
    push_one_by_one(graph, camera, raw, [jpeg(5)])
    expected = np.asarray(decode(np.frombuffer(jpeg(5), np.uint8), cv2.IMREAD_COLOR))
    assert np.array_equal(image_to_array(raw.messages[0]), expected)
    graph.wait_until(
        lambda: bool(packed.messages) and packed.messages[-1].header == raw.messages[0].header, "the same as JPEG"
    )


def test_comes_back_under_another_number_and_leaves_the_other_eye_alone(
    graph: Any, machine: FakeMachine, start: Callable[..., CameraNode]
) -> None:
    left, right = machine.plug_in(0, serial="AAA"), machine.plug_in(2, serial="BBB", port="3-1")
    start("left", device="serial:AAA", **{"control.brightness": 7})
    start("right", device="serial:BBB")
    lefts = Listener(graph, CompressedImage, "/left/image_raw/compressed")
    rights = Listener(graph, CompressedImage, "/right/image_raw/compressed")
    connected(graph, left, lefts)
    connected(graph, right, rights)
    machine.unplug(0)

    def failed(status: DiagnosticStatus) -> bool:
        return status.level == DiagnosticStatus.ERROR and "is gone" in status.message

    assert "BBB" in graph.diagnostic("left/camera_node: camera", failed).message  # the candidates
    push_one_by_one(graph, right, rights, [jpeg(n) for n in range(5)])
    machine.plug_in(4, left, serial="AAA", port="1-2")
    push_until(graph, left, lambda: bool(lefts.messages), "a frame after the reconnect")
    assert left.controls[0x00980900].value == 7

    def is_back(status: DiagnosticStatus) -> bool:
        values = {entry.key: entry.value for entry in status.values}
        return values["reconnects"] == "1" and int(values["fault.unplugged"]) == 1 and values["mode"] != "none"

    graph.diagnostic("left/camera_node: camera", is_back)


def test_a_camera_that_is_not_there_yet_is_waited_for(
    graph: Any, machine: FakeMachine, start: Callable[..., CameraNode]
) -> None:
    machine.plug_in(2, serial="BBB", port="3-1")
    node = start(device="serial:AAA")
    status = graph.diagnostic("left/camera_node: camera", lambda s: s.level == DiagnosticStatus.ERROR)
    assert "serial:AAA" in status.message
    assert "BBB" in status.message
    camera = machine.plug_in(0, serial="AAA")
    listener = Listener(graph, CompressedImage, "/left/image_raw/compressed")
    connected(graph, camera, listener)
    graph.wait_until(lambda: node.has_parameter("control.gain"), "its controls are declared")


@pytest.mark.parametrize(
    ("parameters", "error", "words"),
    [
        ({"width_px": 1024, "height_px": 768}, ModeMismatchError, ["1024x768", "640x480"]),
        ({"device": "/none/clip.avi"}, FileMissingError, ["/none/clip.avi"]),
        ({"control.brightness": 1000}, ControlError, ["brightness", "1000", "-64 to 64"]),
        ({"control.exposure_time_absolute": 100}, ControlError, ["automatic mode"]),
        ({"with_px": 640}, ParameterError, ["with_px"]),
        ({"camera_info_url": "left.yaml"}, ValueError, ["camera_info_url", "file:///PATH"]),
    ],
)
def test_what_the_user_must_mend_ends_the_node(
    machine: FakeMachine,
    start: Callable[..., CameraNode],
    parameters: dict[str, Any],
    error: type[Exception],
    words: list[str],
) -> None:
    machine.plug_in(0)
    with pytest.raises(error) as caught:
        start(**parameters)
    assert all(word in str(caught.value) for word in words)
    assert machine.kernel.open_descriptors == []


def test_controls_are_parameters(graph: Any, machine: FakeMachine, start: Callable[..., CameraNode]) -> None:
    camera = machine.plug_in(0)
    node = start(**{"control.power_line_frequency": "60 Hz", "control.auto_exposure": "Manual Mode"})
    client = graph.client.create_client(DescribeParameters, "/left/camera_node/describe_parameters")
    names = ["control.exposure_time_absolute", "control.power_line_frequency", "control.focus_absolute"]
    graph.wait_until(client.service_is_ready, "the parameter services")
    exposure, menu, focus = graph.wait(client.call_async(DescribeParameters.Request(names=names))).descriptors
    assert (exposure.integer_range[0].from_value, exposure.integer_range[0].to_value) == (3, 2047)
    assert focus.integer_range[0].step == 5
    assert menu.additional_constraints == "one of 'Disabled', '50 Hz', '60 Hz'"
    assert node.get_parameter("control.power_line_frequency").value == "60 Hz"
    assert camera.controls[v4l2.CID_EXPOSURE_AUTO].value == 1

    assert graph.set_parameters(node, **{"control.exposure_time_absolute": 77}).successful
    assert camera.controls[v4l2.CID_EXPOSURE_ABSOLUTE].value == 77
    refused = graph.set_parameters(node, **{"control.gain": 50, "control.power_line_frequency": "55 Hz"})
    assert not refused.successful
    assert "'50 Hz'" in refused.reason
    assert camera.controls[v4l2.CID_GAIN].value == 16
    assert node.get_parameter("control.gain").value == 16


def test_a_request_that_another_check_refuses_never_reaches_the_camera(
    graph: Any, machine: FakeMachine, start: Callable[..., CameraNode]
) -> None:
    camera = machine.plug_in(0)
    node = start()
    assert not graph.set_parameters(node, **{"control.gain": 50, "lock": "follow"}).successful
    assert camera.controls[v4l2.CID_GAIN].value == 16


def test_controls_of_an_absent_camera_cannot_be_set(
    graph: Any, machine: FakeMachine, start: Callable[..., CameraNode]
) -> None:
    machine.plug_in(0)
    node = start()
    machine.unplug(0)
    graph.diagnostic("left/camera_node: camera", lambda s: s.level == DiagnosticStatus.ERROR)
    result = graph.set_parameters(node, **{"control.gain": 50})
    assert not result.successful
    assert "not connected" in result.reason


def info_of(graph: Any, camera: FakeCamera) -> CameraInfo:
    listener = Listener(graph, CameraInfo, "/left/camera_info")
    connected(graph, camera, listener)
    push_one_by_one(graph, camera, listener, [jpeg(1)])
    return listener.messages[-1]


def test_a_calibration_is_published_from_its_url(
    graph: Any, machine: FakeMachine, start: Callable[..., CameraNode], tmp_path: Path
) -> None:
    camera = machine.plug_in(0)
    path = tmp_path / "left.yaml"
    save_calibration(Calibration(640, 480, K, (-0.3, 0.1, 0.0, 0.0, 0.0)), path)
    start(camera_info_url=path.as_uri())
    info = info_of(graph, camera)
    assert tuple(info.k) == K
    assert (info.width, info.height, info.distortion_model, list(info.d)[:2]) == (640, 480, "plumb_bob", [-0.3, 0.1])
    assert info.header.frame_id == "left_camera_optical_frame"
    graph.diagnostic("calibration", lambda s: s.level == DiagnosticStatus.OK)


def test_a_calibration_for_another_size_is_blanked_with_a_warning(
    graph: Any, machine: FakeMachine, start: Callable[..., CameraNode], tmp_path: Path
) -> None:
    camera = machine.plug_in(0)
    path = tmp_path / "left.yaml"
    save_calibration(Calibration(1280, 720, K, (0.0,) * 5), path)
    start(camera_info_url=path.as_uri())
    info = info_of(graph, camera)
    assert (info.width, info.height) == (640, 480)
    assert not any(info.k)
    status = graph.diagnostic("calibration", lambda s: s.level == DiagnosticStatus.WARN)
    assert "1280x720" in status.message
    assert "640x480" in status.message


def test_set_camera_info_saves_and_publishes(
    graph: Any, machine: FakeMachine, start: Callable[..., CameraNode], ros_home: Path
) -> None:
    camera = machine.plug_in(0)
    start()
    client = graph.client.create_client(SetCameraInfo, "/left/set_camera_info")
    graph.wait_until(client.service_is_ready, "the service")
    assert not any(info_of(graph, camera).k)
    wanted = CameraInfo(width=640, height=480, k=K, d=[0.1] * 5, distortion_model="plumb_bob")
    answer = graph.wait(client.call_async(SetCameraInfo.Request(camera_info=wanted)))
    assert answer.success, answer.status_message
    saved = load_calibration(ros_home / "camera_info" / "left.yaml")
    assert (saved.k, saved.name) == (K, "left")
    assert tuple(info_of(graph, camera).k) == K
    wrong = CameraInfo(width=320, height=240, k=K, d=[0.1] * 5, distortion_model="plumb_bob")
    answer = graph.wait(client.call_async(SetCameraInfo.Request(camera_info=wrong)))
    assert not answer.success
    assert "640x480" in answer.status_message
    assert load_calibration(ros_home / "camera_info" / "left.yaml") == saved


@pytest.fixture
def playing() -> Iterator[Callable[..., None]]:
    stops: list[Callable[[], None]] = []

    def play(camera: FakeCamera, rate_hz: float) -> None:
        picture = jpeg(0)
        stops.append(camera.play(lambda number: picture, rate_hz))

    yield play
    for stop in stops:
        stop()


def test_both_eyes_are_locked_to_one_exposure_and_white_balance(
    graph: Any, machine: FakeMachine, start: Callable[..., CameraNode], playing: Callable[..., None]
) -> None:
    left, right = machine.plug_in(0, serial="AAA"), machine.plug_in(2, serial="BBB", port="3-1")
    left.controls[v4l2.CID_EXPOSURE_ABSOLUTE].value = 321
    left.controls[v4l2.CID_WHITE_BALANCE_TEMPERATURE].value = 5500
    playing(left, 20.0)
    playing(right, 20.0)
    leader = start("left", device="serial:AAA", lock="hold", lock_after_s=0.0)
    start("right", device="serial:BBB", lock="follow", partner="/left/camera_node")
    graph.wait_until(lambda: right.controls[v4l2.CID_EXPOSURE_ABSOLUTE].value == 321, "the right eye follows")
    locked = (v4l2.CID_EXPOSURE_AUTO, v4l2.CID_AUTO_WHITE_BALANCE, v4l2.CID_WHITE_BALANCE_TEMPERATURE, v4l2.CID_GAIN)
    assert [right.controls[cid].value for cid in locked] == [1, 0, 5500, 16]
    assert leader.get_parameter("control.exposure_time_absolute").value == 321
    assert graph.set_parameters(leader, **{"control.exposure_time_absolute": 200, "control.gain": 30}).successful
    graph.wait_until(lambda: right.controls[v4l2.CID_EXPOSURE_ABSOLUTE].value == 200, "and follows a change")
    assert right.controls[v4l2.CID_GAIN].value == 30


def test_the_pair_is_judged(
    graph: Any, machine: FakeMachine, start: Callable[..., CameraNode], playing: Callable[..., None]
) -> None:
    left, right = machine.plug_in(0, serial="AAA"), machine.plug_in(2, serial="BBB", port="1-2")
    right.controls[v4l2.CID_GAIN].value = 99
    playing(left, 20.0)
    playing(right, 10.0)
    start("left", device="serial:AAA")
    start("right", device="serial:BBB", partner="/left/camera_node")

    def complete(status: DiagnosticStatus) -> bool:
        return all(text in status.message for text in ("share USB controller", "gain", "Hz"))

    status = graph.diagnostic("right/camera_node: pair", complete)
    assert status.level == DiagnosticStatus.WARN
    values = {entry.key: entry.value for entry in status.values}
    assert math.isfinite(float(values["skew_ms"]))
    assert 0.0 < float(values["partner_rate_hz"]) < 21.0


def test_damaged_frames_are_counted_not_published(
    graph: Any, machine: FakeMachine, start: Callable[..., CameraNode]
) -> None:
    camera = machine.plug_in(0)
    start()
    listener = Listener(graph, CompressedImage, "/left/image_raw/compressed")
    connected(graph, camera, listener)
    for data in (jpeg(1)[:2000], jpeg(1, 320, 240)):
        camera.push(data)
        graph.wait_until(lambda: not camera.filled, "it is taken")
    push_one_by_one(graph, camera, listener, [jpeg(2)])
    assert [bytes(message.data) for message in listener.messages] == [jpeg(2)]

    def counted(status: DiagnosticStatus) -> bool:
        values = {entry.key: entry.value for entry in status.values}
        return (values["dropped_corrupt"], values["fault.wrong_size"]) == ("2", "1")

    graph.diagnostic("left/camera_node: camera", counted)


def test_parameters_of_the_loop_change_at_run_time(
    graph: Any, machine: FakeMachine, start: Callable[..., CameraNode]
) -> None:
    camera = machine.plug_in(0)
    node = start()
    listener = Listener(graph, CompressedImage, "/left/image_raw/compressed")
    connected(graph, camera, listener)
    assert graph.set_parameters(node, stamp_offset_s=0.1).successful
    time.sleep(0.11)  # stamps go on increasing: the shift shows once it is made up for
    captured_ns, latest_ns = time.monotonic_ns(), time.time_ns()
    assert camera.push(jpeg(1), captured_ns)
    listener.wait_for(1)
    assert to_nanoseconds(listener.messages[0].header.stamp) < latest_ns - 99 * MS
    result = graph.set_parameters(node, max_age_s=0.0)
    assert not result.successful
    assert "max_age_s" in result.reason
    assert not node.set_parameters([Parameter("device", value="1")])[0].successful


@pytest.mark.parametrize("frame_id", ["", "a", "abc", "abcd", "left_camera_optical_frame", "äöü"])
@pytest.mark.parametrize("size", [0, 1, 1001])
def test_the_serialised_message_is_what_the_middleware_makes(frame_id: str, size: int) -> None:
    data = bytes(range(256)) * 4
    stamp_ns = 1_795_369_597_195_928_723
    message = CompressedImage(header=Header(stamp=from_nanoseconds(stamp_ns), frame_id=frame_id), format="jpeg")
    message.data = data[:size]
    serialised = JpegSerializer(frame_id)(data[:size], stamp_ns)
    assert deserialize_message(serialised, CompressedImage) == message
    # In between and at the end the middleware pads with whatever lay in its memory.
    assert len(serialize_message(message)) - len(serialised) in range(4)


def test_simulated_time_rules_the_stamps(graph: Any, machine: FakeMachine, start: Callable[..., CameraNode]) -> None:
    camera = machine.plug_in(0)
    node = start(use_sim_time=True)
    clock = graph.client.create_publisher(Clock, "/clock", 1)
    graph.wait_until(lambda: clock.get_subscription_count() > 0, "the node listens to the clock")
    clock.publish(Clock(clock=from_nanoseconds(1000 * 1000 * MS)))
    graph.wait_until(lambda: node.get_clock().now().nanoseconds == 1000 * 1000 * MS, "it has the time")
    listener = Listener(graph, CompressedImage, "/left/image_raw/compressed")
    push_until(graph, camera, lambda: bool(listener.messages), "a frame")
    stamp_ns = to_nanoseconds(listener.messages[-1].header.stamp)
    assert 900 * 1000 * MS < stamp_ns <= 1000 * 1000 * MS
