"""The doctor streams from all cameras together and says what is wrong with them and with the pair."""

import errno
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from vergence_camera.devices import SystemTree
from vergence_camera.doctor import check
from vergence_camera.testing.fake_camera import FakeCamera
from vergence_camera.testing.fake_kernel import FakeKernel
from vergence_camera.testing.fake_machine import FakeMachine
from vergence_camera.v4l2 import structures as v4l2
from vergence_rig.finding import Finding


class Pair:
    """Two webcams on controllers of their own, playing at their rates."""

    def __init__(self, machine: FakeMachine, make_jpeg: Callable[..., bytes], second: str = "0000:05:00.3") -> None:
        self.machine = machine
        self.cameras = [
            machine.plug_in(0, serial="AAA", port="1-1"),
            machine.plug_in(2, serial="BBB", port="3-1", controller=second),
        ]
        self.picture = make_jpeg(0)
        self.stops: list[Callable[[], None]] = []

    def play(self, *rates_hz: float) -> None:
        for camera, rate_hz in zip(self.cameras, rates_hz, strict=True):
            self.stops.append(camera.play(lambda number: self.picture, rate_hz))

    def findings(self, timeout_s: float = 60.0) -> dict[str, Finding]:
        machine = self.machine
        found = check(kernel=machine.kernel, tree=machine.tree, trial_s=0.5, timeout_s=timeout_s, max_skew_s=0.05)
        assert machine.kernel.open_descriptors == []
        return {finding.name.split()[0] + finding.name[-1]: finding for finding in found}


@pytest.fixture
def pair(machine: FakeMachine, make_jpeg: Callable[..., bytes]) -> Iterator[Pair]:
    made = Pair(machine, make_jpeg)
    yield made
    for stop in made.stops:
        stop()


def test_a_good_pair(pair: Pair) -> None:
    pair.play(30.0, 30.0)
    findings = pair.findings()
    assert findings["stream0"].message.startswith("MJPG 640x480 at 30 Hz: ")
    assert "0 damaged" in findings["stream2"].message
    assert "ms apart" in findings["pair2"].message


def test_different_rates_and_exposures(pair: Pair) -> None:
    pair.play(30.0, 12.0)
    pair.cameras[1].controls[v4l2.CID_GAIN].value = 90
    pair.cameras[0].timestamp_flags = 0
    findings = pair.findings()
    assert not findings["stream2"].ok
    assert not findings["pair2"].ok
    assert "gain 16 and 90" in findings["pair2"].message
    assert "Hz" in findings["pair2"].message
    assert "hold" in findings["pair2"].remedy


def test_a_shared_controller(machine: FakeMachine, make_jpeg: Callable[..., bytes]) -> None:
    pair = Pair(machine, make_jpeg, second="0000:00:14.0")
    pair.play(30.0, 30.0)
    finding = pair.findings()["pair2"]
    assert not finding.ok
    assert "share USB controller 0000:00:14.0" in finding.message
    for stop in pair.stops:
        stop()


def test_no_bandwidth_for_the_second(pair: Pair) -> None:
    pair.cameras[1].stream_errno = errno.ENOSPC
    pair.play(30.0, 30.0)
    finding = pair.findings()["stream2"]
    assert not finding.ok
    assert "USB bandwidth" in finding.message


def test_a_camera_that_another_process_uses(pair: Pair) -> None:
    pair.cameras[0].streamer = 1
    finding = pair.findings(timeout_s=0.1)["stream0"]
    assert finding.ok
    assert "/diagnostics" in finding.message


def test_silence(pair: Pair) -> None:
    finding = pair.findings(timeout_s=0.1)["stream0"]
    assert not finding.ok
    assert "0 frames received" in finding.message


def test_permission_and_old_usb(machine: FakeMachine) -> None:
    camera = machine.plug_in(0, FakeCamera(sizes={"YUYV": {(640, 480): (30,)}}), serial="AAA", speed="12")
    kernel, tree = machine.kernel, machine.tree
    messages = " ".join(f.message for f in check(kernel=kernel, tree=tree, trial_s=0.0) if not f.ok)
    assert "no MJPG" in messages
    assert "12 Mbit/s" in messages
    camera.open_errno = errno.EACCES
    (refused,) = [f for f in check(kernel=kernel, tree=tree, trial_s=0.0) if not f.ok]
    assert "usermod" in refused.message


def test_no_camera(tmp_path: Path) -> None:
    (finding,) = check(kernel=FakeKernel({}), tree=SystemTree(tmp_path, tmp_path))
    assert not finding.ok
