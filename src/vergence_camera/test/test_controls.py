"""Controls over the fake's ioctls: names, ranges, menus, all or nothing, and wanted values that outlive the camera."""

import errno

import pytest

from vergence_camera.control_port import ControlPort
from vergence_camera.errors import ControlError, DisconnectedError
from vergence_camera.testing.fake_camera import FakeCamera
from vergence_camera.testing.fake_controls import FakeControl
from vergence_camera.testing.fake_kernel import FakeKernel
from vergence_camera.v4l2 import structures as v4l2
from vergence_camera.v4l2.controls import Controls

PATH = "/dev/video0"
NAMES = [
    *("brightness", "white_balance_automatic", "gain", "power_line_frequency", "white_balance_temperature"),
    *("auto_exposure", "exposure_time_absolute", "focus_absolute"),
]


@pytest.fixture
def camera() -> FakeCamera:
    return FakeCamera()


@pytest.fixture
def kernel(camera: FakeCamera) -> FakeKernel:
    return FakeKernel({PATH: camera})


def open_controls(kernel: FakeKernel) -> Controls:
    return Controls(kernel, kernel.open(PATH), PATH)


@pytest.mark.parametrize("extended", [True, False])
def test_settings_are_enumerated_by_both_queries(kernel: FakeKernel, camera: FakeCamera, extended: bool) -> None:
    """Headings and buttons are no settings."""
    camera.extended_query = extended
    specs = open_controls(kernel).specs()
    assert list(specs) == NAMES
    exposure = specs["exposure_time_absolute"]
    assert (exposure.minimum, exposure.maximum, exposure.step, exposure.default) == (3, 2047, 1, 250)
    assert not exposure.active
    assert specs["auto_exposure"].menu == {1: "Manual Mode", 3: "Aperture Priority Mode"}
    assert specs["focus_absolute"].allowed == "a whole number from 0 to 250 in steps of 5"


def test_values_come_in_their_own_types(kernel: FakeKernel) -> None:
    values = open_controls(kernel).values()
    assert values["white_balance_automatic"] is True
    assert values["power_line_frequency"] == "50 Hz"
    assert values["brightness"] == 0


def test_integer_menus_and_unnamed_values() -> None:
    link = FakeControl(0x009F0901, "Link Frequency", v4l2.CTRL_INTEGER_MENU, 0, 1, 1, 1, menu={0: "100", 1: "250"})
    odd = FakeControl(0x009F0902, "Odd Menu", v4l2.CTRL_MENU, 0, 3, 1, 2, menu={0: "zero", 3: "three"})
    controls = open_controls(FakeKernel({PATH: FakeCamera(controls=[link, odd])}))
    assert controls.values() == {"link_frequency": "250", "odd_menu": "2"}
    assert controls.apply({"link_frequency": "100"}) == {"link_frequency": "100"}


@pytest.mark.parametrize(
    ("name", "value", "allowed"),
    [
        ("brightness", 65, "from -64 to 64"),
        ("brightness", 1.5, "from -64 to 64"),
        ("brightness", True, "from -64 to 64"),
        ("focus_absolute", 7, "steps of 5"),
        ("white_balance_automatic", 1, "true or false"),
        ("power_line_frequency", "55 Hz", "'50 Hz', '60 Hz'"),
        ("sharpness", 1, "the camera has brightness"),
    ],
)
def test_what_is_not_allowed_is_said_and_nothing_is_set(
    kernel: FakeKernel, camera: FakeCamera, name: str, value: object, allowed: str
) -> None:
    before = {cid: control.value for cid, control in camera.controls.items()}
    with pytest.raises(ControlError) as caught:
        open_controls(kernel).apply({"gain": 50, name: value})
    assert name in str(caught.value)
    assert allowed in str(caught.value)
    assert {cid: control.value for cid, control in camera.controls.items()} == before


def test_automatic_modes_are_switched_before_what_they_own(kernel: FakeKernel) -> None:
    wanted = {"exposure_time_absolute": 100, "auto_exposure": "Manual Mode", "gain": 3}
    assert open_controls(kernel).apply(wanted) == wanted


def test_a_control_that_an_automatic_mode_holds(kernel: FakeKernel) -> None:
    with pytest.raises(ControlError, match=r"held by an automatic mode.*auto_exposure is 'Aperture Priority Mode'"):
        open_controls(kernel).apply({"exposure_time_absolute": 100})


def test_a_refusal_half_way_restores_what_was_set(kernel: FakeKernel, camera: FakeCamera) -> None:
    controls = open_controls(kernel)
    changes = {"white_balance_automatic": False, "gain": 77, "exposure_time_absolute": 100}
    before = controls.values()
    with pytest.raises(ControlError):
        controls.apply(changes)
    assert controls.values() == before
    assert before["gain"] == 16


def test_read_only(kernel: FakeKernel, camera: FakeCamera) -> None:
    camera.controls[v4l2.CID_GAIN].flags |= v4l2.FLAG_READ_ONLY
    with pytest.raises(ControlError, match="read-only"):
        open_controls(kernel).apply({"gain": 1})


def attach(port: ControlPort, kernel: FakeKernel) -> None:
    port.attach(kernel, kernel.open(PATH), PATH)


def test_wanted_values_survive_the_unplugging(kernel: FakeKernel, camera: FakeCamera) -> None:
    port = ControlPort()
    port.set_initial({"brightness": 10})
    attach(port, kernel)
    port.set({"gain": 40})
    port.detach()
    camera.unplug()
    camera.plug_in()
    assert camera.controls[v4l2.CID_GAIN].value == 16
    attach(port, kernel)
    assert (port.values()["brightness"], port.values()["gain"]) == (10, 40)


def test_wrong_wanted_values_fail_the_first_time_and_are_said_later(kernel: FakeKernel) -> None:
    said: list[str] = []
    port = ControlPort(said.append)
    port.set_initial({"brightness": 1000})
    with pytest.raises(ControlError, match="1000"):
        attach(port, kernel)
    assert not port.attached
    port = ControlPort(said.append)
    attach(port, kernel)
    port.detach()
    port.set_initial({"brightness": 1000})
    attach(port, kernel)
    assert "1000" in said[0]


def test_an_absent_camera(kernel: FakeKernel) -> None:
    port = ControlPort()
    assert port.values() == {}
    with pytest.raises(DisconnectedError):
        port.set({"gain": 1})
    attach(port, kernel)
    port.detach()
    assert "gain" in port.specs()


def test_hold_freezes_what_the_automatic_modes_found(kernel: FakeKernel, camera: FakeCamera) -> None:
    port = ControlPort()
    attach(port, kernel)
    camera.controls[v4l2.CID_EXPOSURE_ABSOLUTE].value = 333
    camera.controls[v4l2.CID_WHITE_BALANCE_TEMPERATURE].value = 5000
    assert port.follow({}) == {
        "auto_exposure": "Manual Mode",
        "white_balance_automatic": False,
        "exposure_time_absolute": 333,
        "white_balance_temperature": 5000,
        "gain": 16,
    }
    assert set(port.locked_names()) == set(port.follow({}))


def test_follow_takes_the_other_eye_over_and_clips_into_its_own_range(kernel: FakeKernel) -> None:
    port = ControlPort()
    attach(port, kernel)
    leader = {"exposure_time_absolute": 5000, "white_balance_temperature": 4444, "gain": 9, "hue": 1}
    values = port.follow(leader)
    assert values["exposure_time_absolute"] == 2047
    assert values["white_balance_temperature"] == 4440
    assert values["gain"] == 9
    assert values["auto_exposure"] == "Manual Mode"
    assert "hue" not in values


@pytest.mark.parametrize("state", [{"auto_exposure": "Aperture Priority Mode"}, {"white_balance_automatic": True}])
def test_a_leader_that_is_still_automatic_is_not_followed(
    kernel: FakeKernel, camera: FakeCamera, state: dict[str, object]
) -> None:
    port = ControlPort()
    attach(port, kernel)
    with pytest.raises(ControlError, match="set its lock to 'hold'"):
        port.follow({"gain": 9, **state})
    assert camera.controls[v4l2.CID_GAIN].value == 16


def test_a_camera_without_a_manual_mode_is_followed_as_far_as_it_goes() -> None:
    gain = FakeControl(v4l2.CID_GAIN, "Gain", v4l2.CTRL_INTEGER, 0, 10, 1, 5)
    automatic = FakeControl(v4l2.CID_EXPOSURE_AUTO, "Auto Exposure", v4l2.CTRL_MENU, 0, 3, 1, 3, menu={3: "Aperture"})
    kernel = FakeKernel({PATH: FakeCamera(controls=[gain, automatic])})
    port = ControlPort()
    attach(port, kernel)
    assert port.follow({"gain": 7}) == {"gain": 7}


@pytest.mark.parametrize("number", [errno.EIO, errno.EPIPE])
def test_a_control_that_cannot_be_read_hides_no_other(kernel: FakeKernel, camera: FakeCamera, number: int) -> None:
    camera.controls[v4l2.CID_GAIN].read_errno = number
    port = ControlPort()
    attach(port, kernel)
    assert set(port.values()) == set(NAMES) - {"gain"}
    assert "gain" not in port.follow({})
    with pytest.raises(ControlError, match="'gain' cannot be read"):
        port.set({"gain": 3})


def test_a_value_read_while_it_is_unplugged_is_no_crash(kernel: FakeKernel, camera: FakeCamera) -> None:
    port = ControlPort()
    attach(port, kernel)
    camera.unplug()
    assert port.values() == {}
