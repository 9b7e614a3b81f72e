"""camera_node in one process with cameras that the test plugs in and out."""

import itertools
import time
from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CompressedImage, Image

from vergence_camera.errors import ControlError, FileMissingError, ModeMismatchError
from vergence_camera.ros.camera_node import CameraNode
from vergence_camera.testing.fake_machine import FakeMachine
from vergence_common.images import image_to_array
from vergence_common.stamps import from_nanoseconds, to_nanoseconds
from vergence_msgs.srv import GetStoredImage
from vergence_rig.parameters import ParameterError

pytestmark = pytest.mark.graph

MS = 1_000_000


def test_each_jpeg_goes_out_untouched_once_with_the_kernels_stamp(
    graph: Any, machine: FakeMachine, start: Callable[..., CameraNode], jpeg: Any, listen: Any, connected: Any
) -> None:
    camera = machine.plug_in(0, serial="AAA")
    start()
    listener = listen(CompressedImage, "/left/image_raw/compressed")
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
    graph: Any,
    machine: FakeMachine,
    start: Callable[..., CameraNode],
    monkeypatch: pytest.MonkeyPatch,
    jpeg: Any,
    listen: Any,
    push_one_by_one: Any,
    connected: Any,
) -> None:
    decoded: list[int] = []
    decode = cv2.imdecode

    def counted(*arguments: Any) -> Any:
        decoded.append(1)
        return decode(*arguments)

    monkeypatch.setattr("vergence_camera.pixels.cv2.imdecode", counted)
    camera = machine.plug_in(0)
    start()
    packed = listen(CompressedImage, "/left/image_raw/compressed")
    connected(graph, camera, packed)
    push_one_by_one(graph, camera, packed, [jpeg(n) for n in range(3)])
    assert decoded == []
    raw = listen(Image, "/left/image_raw")
    connected(graph, camera, raw)
    push_one_by_one(graph, camera, raw, [jpeg(5)])
    expected = np.asarray(decode(np.frombuffer(jpeg(5), np.uint8), cv2.IMREAD_COLOR))
    assert np.array_equal(image_to_array(raw.messages[0]), expected)
    graph.wait_until(
        lambda: bool(packed.messages) and packed.messages[-1].header == raw.messages[0].header, "the same as JPEG"
    )


def test_comes_back_under_another_number_and_leaves_the_other_eye_alone(
    graph: Any,
    machine: FakeMachine,
    start: Callable[..., CameraNode],
    jpeg: Any,
    listen: Any,
    push_until: Any,
    push_one_by_one: Any,
    connected: Any,
) -> None:
    left, right = machine.plug_in(0, serial="AAA"), machine.plug_in(2, serial="BBB", port="3-1")
    start("left", device="serial:AAA", **{"control.brightness": 7})
    start("right", device="serial:BBB")
    lefts = listen(CompressedImage, "/left/image_raw/compressed")
    rights = listen(CompressedImage, "/right/image_raw/compressed")
    connected(graph, left, lefts)
    connected(graph, right, rights)
    machine.unplug(0)

    def failed(status: DiagnosticStatus) -> bool:
        return status.level == DiagnosticStatus.ERROR and "there are: " in status.message

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
    graph: Any, machine: FakeMachine, start: Callable[..., CameraNode], listen: Any, connected: Any
) -> None:
    machine.plug_in(2, serial="BBB", port="3-1")
    node = start(device="serial:AAA")
    status = graph.diagnostic("left/camera_node: camera", lambda s: s.level == DiagnosticStatus.ERROR)
    assert "serial:AAA" in status.message
    assert "BBB" in status.message
    camera = machine.plug_in(0, serial="AAA")
    listener = listen(CompressedImage, "/left/image_raw/compressed")
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


def test_damaged_frames_are_counted_not_published(
    graph: Any,
    machine: FakeMachine,
    start: Callable[..., CameraNode],
    jpeg: Any,
    listen: Any,
    push_one_by_one: Any,
    connected: Any,
) -> None:
    camera = machine.plug_in(0)
    start()
    listener = listen(CompressedImage, "/left/image_raw/compressed")
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
    graph: Any, machine: FakeMachine, start: Callable[..., CameraNode], jpeg: Any, listen: Any, connected: Any
) -> None:
    camera = machine.plug_in(0)
    node = start()
    listener = listen(CompressedImage, "/left/image_raw/compressed")
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


def test_simulated_time_rules_the_stamps(
    graph: Any, machine: FakeMachine, start: Callable[..., CameraNode], listen: Any, push_until: Any
) -> None:
    camera = machine.plug_in(0)
    node = start(use_sim_time=True)
    clock = graph.client.create_publisher(Clock, "/clock", 1)
    graph.wait_until(lambda: clock.get_subscription_count() > 0, "the node listens to the clock")
    clock.publish(Clock(clock=from_nanoseconds(1000 * 1000 * MS)))
    graph.wait_until(lambda: node.get_clock().now().nanoseconds == 1000 * 1000 * MS, "it has the time")
    listener = listen(CompressedImage, "/left/image_raw/compressed")
    push_until(graph, camera, lambda: bool(listener.messages), "a frame")
    stamp_ns = to_nanoseconds(listener.messages[-1].header.stamp)
    assert 900 * 1000 * MS < stamp_ns <= 1000 * 1000 * MS


def test_frames_that_are_all_too_old_are_no_healthy_stream(
    graph: Any, machine: FakeMachine, start: Callable[..., CameraNode], playing: Callable[..., None]
) -> None:
    camera = machine.plug_in(0)
    start(stamp_offset_s=0.9, max_age_s=0.25, stall_timeout_s=0.2)
    playing(camera, 30.0)
    status = graph.diagnostic("camera_node: camera", lambda s: "no image is published" in s.message)
    assert status.level == DiagnosticStatus.ERROR
    assert "frames are older than max_age_s" in status.message


def test_an_image_of_the_last_second_can_be_had_without_receiving_any(
    graph: Any, machine: FakeMachine, start: Callable[..., CameraNode], jpeg: Any
) -> None:
    camera = machine.plug_in(0, serial="AAA")
    node = start()
    pictures = [jpeg(number) for number in range(4)]
    for number, picture in enumerate(pictures):
        graph.wait_until(lambda n=number: len(node._stored._kept) == n, "the frame before is stored")
        camera.push(picture, time.monotonic_ns())
        time.sleep(0.02)  # stamps that differ by more than what they are corrected by
    graph.wait_until(lambda: len(node._stored._kept) == len(pictures), "all are stored")
    client = graph.client.create_client(GetStoredImage, "left/get_stored_image")
    graph.wait_until(client.service_is_ready, "the service")
    for (stamp_ns, _), picture in zip(list(node._stored._kept), pictures, strict=True):
        answer = graph.wait(client.call_async(GetStoredImage.Request(stamp=from_nanoseconds(stamp_ns + MS))))
        assert answer.found
        assert to_nanoseconds(answer.header.stamp) == stamp_ns
        assert bytes(answer.jpeg) == picture
