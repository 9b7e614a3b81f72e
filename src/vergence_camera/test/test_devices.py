"""Enumeration over a machine's tree, choosing by any name, and staying with the camera that was chosen."""

from pathlib import Path

import pytest

from vergence_camera.devices import Device, PinnedChoice, SystemTree, choose, find_devices, list_devices
from vergence_camera.errors import AmbiguousCameraError, CameraNotFoundError, ChoiceError
from vergence_camera.list_cameras import table
from vergence_camera.testing.fake_kernel import FakeKernel
from vergence_camera.testing.fake_machine import FakeMachine


@pytest.fixture
def pair(machine: FakeMachine) -> SystemTree:
    machine.plug_in(0, serial="AAA111", port="1-1.2", controller="0000:00:14.0")
    machine.plug_in(2, serial="BBB222", port="3-4", controller="0000:05:00.3", name="Other Cam", product="0999")
    return machine.tree


def test_finds_the_cameras_and_not_their_metadata_devices(pair: SystemTree) -> None:
    first, second = find_devices(pair)
    assert (first.path, first.number, first.serial) == (str(pair.dev / "video0"), 0, "AAA111")
    assert (first.vendor, first.product, first.usb_port) == ("046d", "0826", "1-1.2")
    assert (first.controller, second.controller) == ("0000:00:14.0", "0000:05:00.3")
    assert Path(first.by_id[0]).name == "usb-046d_HD_Webcam_C525_AAA111-video-index0"
    assert Path(second.by_path[0]).name == "pci-0000:05:00.3-usb-0:4:1.0-video-index0"


def test_an_empty_machine(tmp_path: Path) -> None:
    tree = SystemTree(tmp_path / "sys", tmp_path / "dev")
    assert find_devices(tree) == []
    assert "no cameras" in table(list_devices(FakeKernel({}), tree))


def test_every_name_chooses_the_camera(pair: SystemTree) -> None:
    devices = find_devices(pair)
    for device in devices:
        names = [*device.names, str(device.number), f"serial:{device.serial}", f"port:{device.usb_port}"]
        assert len(names) > 8
        for name in names:
            assert choose(name, devices) is device


@pytest.mark.parametrize("text", ["7", "/dev/video9", "serial:CCC", "usb-nothing", "port:9-9", "number:5"])
def test_a_wrong_choice_lists_the_candidates(pair: SystemTree, text: str) -> None:
    with pytest.raises(CameraNotFoundError) as caught:
        choose(text, find_devices(pair))
    message = str(caught.value)
    assert text in message
    for part in ("video0", "AAA111", "by-id", "video2", "BBB222", "Other Cam"):
        assert part in message


def test_a_rule_without_a_value_is_refused(pair: SystemTree) -> None:
    with pytest.raises(ChoiceError, match="follow 'serial:'"):
        choose("serial:", find_devices(pair))


def test_twins_are_ambiguous_by_name_and_serial_but_not_by_path(machine: FakeMachine) -> None:
    machine.plug_in(0, serial="SN0001", port="1-1")
    machine.plug_in(2, serial="SN0001", port="1-2")
    devices = find_devices(machine.tree)
    for text in ("SN0001", "serial:SN0001", devices[0].name):
        with pytest.raises(AmbiguousCameraError, match=r"by-path.*video0.*video2"):
            choose(text, devices)
    assert choose(devices[1].by_path[0], devices) is devices[1]
    assert choose("port:1-1", devices) is devices[0]


def test_a_serial_is_followed_to_another_number_and_port(machine: FakeMachine) -> None:
    machine.plug_in(0, serial="AAA111", port="1-1")
    pinned = PinnedChoice("0", machine.tree)
    assert pinned.resolve().endswith("video0")
    machine.unplug(0)
    with pytest.raises(CameraNotFoundError, match="was unplugged"):
        pinned.resolve()
    machine.plug_in(0, serial="ZZZ999", port="1-3", name="Intruder")
    with pytest.raises(CameraNotFoundError, match="Intruder"):
        pinned.resolve()
    machine.plug_in(4, serial="AAA111", port="1-2")
    assert pinned.resolve().endswith("video4")


@pytest.mark.parametrize("serial", ["", "SN0001"])
def test_twins_are_known_again_by_their_port(machine: FakeMachine, serial: str) -> None:
    machine.plug_in(0, serial=serial, port="1-1")
    machine.plug_in(2, serial=serial, port="1-2")
    tree = machine.tree
    left, right = PinnedChoice("port:1-1", tree), PinnedChoice("port:1-2", tree)
    assert left.resolve().endswith("video0")
    assert right.resolve().endswith("video2")
    machine.unplug(0)
    machine.unplug(2)
    machine.plug_in(0, serial=serial, port="1-2")
    with pytest.raises(CameraNotFoundError):
        left.resolve()
    assert right.resolve().endswith("video0")
    machine.plug_in(2, serial=serial, port="1-1")
    assert left.resolve().endswith("video2")


def test_a_device_node_without_sysfs_is_taken_by_its_path(tmp_path: Path) -> None:
    node = tmp_path / "video0"
    node.touch()
    pinned = PinnedChoice(str(node), SystemTree(tmp_path / "sys", tmp_path))
    with pytest.raises(CameraNotFoundError):
        pinned.resolve()  # only what lies in /dev is trusted to be a device


def test_listing_shows_names_paths_controller_formats_and_trouble(pair: SystemTree, machine: FakeMachine) -> None:
    machine.kernel.cameras[str(pair.dev / "video2")].open_errno = 13
    text = table(list_devices(machine.kernel, pair))
    for part in (
        *("HD Webcam C525", "AAA111", "by-id", "by-path", "0000:00:14.0", "480 Mbit/s", "port 1-1.2"),
        *("MJPG     640x480@30/15, 1280x720@30", "YUYV     640x480@30, 1280x720@10", "Permission denied"),
    ):
        assert part in text
    assert "share" not in text
    assert machine.kernel.open_descriptors == []


def test_listing_notes_a_shared_controller(machine: FakeMachine) -> None:
    for number, port in ((0, "1-1"), (2, "1-2")):
        machine.plug_in(number, port=port)
    listed = list_devices(machine.kernel, machine.tree)
    assert "several cameras share USB controller 0000:00:14.0" in table(listed)


def test_listing_leaves_out_what_gives_no_pictures(pair: SystemTree, machine: FakeMachine) -> None:
    machine.kernel.cameras[str(pair.dev / "video0")].capabilities = 0x0400_8000
    assert [entry.device.number for entry in list_devices(machine.kernel, pair)] == [2]


def test_names_are_empty_where_the_bus_has_none() -> None:
    assert Device("/dev/video0", 0, "Camera").names == ("/dev/video0", "Camera")
