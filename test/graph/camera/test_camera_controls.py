"""The controls of fake webcams as parameters of their nodes, and what two eyes have in common."""

import math
from collections.abc import Callable
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from rcl_interfaces.srv import DescribeParameters

from vergence_camera.ros.camera_node import CameraNode
from vergence_camera.testing.fake_machine import FakeMachine
from vergence_camera.v4l2 import structures as v4l2

pytestmark = pytest.mark.graph


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


def test_both_eyes_are_locked_to_one_exposure_and_white_balance(
    graph: Any, machine: FakeMachine, start: Callable[..., CameraNode], playing: Callable[..., None]
) -> None:
    left, right = machine.plug_in(0, serial="AAA"), machine.plug_in(2, serial="BBB", port="3-1")
    left.controls[v4l2.CID_EXPOSURE_ABSOLUTE].value = 321
    left.controls[v4l2.CID_WHITE_BALANCE_TEMPERATURE].value = 5500
    playing(left, 20.0)
    playing(right, 20.0)
    leader = start("left", device="serial:AAA", lock="hold", lock_after_s=0.0)
    follower = start("right", device="serial:BBB", lock="follow", partner="/left/camera_node")
    graph.wait_until(lambda: right.controls[v4l2.CID_EXPOSURE_ABSOLUTE].value == 321, "the right eye follows")
    locked = (v4l2.CID_EXPOSURE_AUTO, v4l2.CID_AUTO_WHITE_BALANCE, v4l2.CID_WHITE_BALANCE_TEMPERATURE, v4l2.CID_GAIN)
    assert [right.controls[cid].value for cid in locked] == [1, 0, 5500, 16]
    assert leader.get_parameter("control.exposure_time_absolute").value == 321
    assert graph.set_parameters(leader, **{"control.exposure_time_absolute": 200, "control.gain": 30}).successful
    graph.wait_until(lambda: right.controls[v4l2.CID_EXPOSURE_ABSOLUTE].value == 200, "and follows a change")
    assert right.controls[v4l2.CID_GAIN].value == 30
    assert follower.has_parameter("control.gain")
    alone = graph.set_parameters(follower, **{"control.gain": 99})
    assert not alone.successful, "the eyes are no longer locked"
    assert "set it on the partner" in alone.reason
    assert right.controls[v4l2.CID_GAIN].value == 30
    assert graph.set_parameters(follower, **{"control.brightness": 5}).successful, "what is not shared is its own"


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
