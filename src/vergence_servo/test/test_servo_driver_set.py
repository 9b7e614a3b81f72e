"""A backend for each joint: which one, what is refused, and one driver of each kind that is opened and closed."""

from dataclasses import dataclass

import pytest

from vergence_rig.parameters import Parameters, parameter
from vergence_rig.rig import default_rig
from vergence_servo.calibration import ServoCalibrationError, servo_limits, servos_from_mapping
from vergence_servo.driver_set import DriverSet, backends_of
from vergence_servo.drivers import registry
from vergence_servo.drivers.fake import FakeDriver
from vergence_servo.drivers.protocol import Backend, DriverIoError, DriverUnavailableError
from vergence_servo.servo_channel import ChannelState
from vergence_servo.servo_head import HeadParameters, ServoHead

JOINTS = ("pan_left", "pan_right", "tilt")


def servos(**backends):
    """Three servos on channels 0, 1 and 0: the tilt's is another backend's."""
    channels = {"pan_left": 0, "pan_right": 1, "tilt": 0}
    return servos_from_mapping(
        {"servos": {n: {"channel": channels[n], "backend": backends.get(n, ""), "model": "sg90"} for n in JOINTS}}
    )


def test_a_joint_has_its_own_backend_or_the_default():
    chosen = backends_of(servos(tilt="pca9685"), JOINTS, "kernel_pwm")
    assert chosen == {"pan_left": "kernel_pwm", "pan_right": "kernel_pwm", "tilt": "pca9685"}


def test_one_channel_of_two_backends_is_two_servos_and_of_one_backend_is_refused():
    assert backends_of(servos(tilt="pigpio"), ("pan_left", "tilt"), "kernel_pwm")["tilt"] == "pigpio"
    with pytest.raises(ServoCalibrationError, match="different channel of backend 'pca9685': got 0 for pan_left"):
        backends_of(servos(tilt="pca9685"), JOINTS, "pca9685")
    with pytest.raises(ServoCalibrationError, match="different channel: got 0 for pan_left and tilt"):
        servos()


@pytest.mark.parametrize(
    ("backend", "text"),
    [("pca9865", r"servos\.tilt\.backend must be one of fake, kernel_pwm"), ("gpiozero", "11 positions")],
)
def test_a_backend_that_cannot_be_used_is_named_with_its_servo(backend, text):
    with pytest.raises(ServoCalibrationError, match=text):
        backends_of(servos(tilt=backend), JOINTS, "kernel_pwm")


def test_an_unknown_joint_and_an_unknown_default_are_named():
    with pytest.raises(ServoCalibrationError, match="joint 'roll' has no servo"):
        backends_of(servos(tilt="fake"), ("roll",), "fake")
    with pytest.raises(DriverUnavailableError, match="parameter 'backend' must be one of"):
        backends_of(servos(tilt="fake"), JOINTS, "none")


@dataclass(frozen=True)
class RecordingParameters(Parameters):
    """Of a backend of this test."""

    resolution_us: float = parameter(1.0, "step", minimum=0.1, maximum=10)


class RecordingDriver(FakeDriver):
    """The fake with a record of what is opened, in order."""

    opened: list["RecordingDriver"] = []  # noqa: RUF012 - cleared by the fixture

    def __init__(self, parameters):
        super().__init__()
        self.step_us, self.cut = parameters.resolution_us, False
        RecordingDriver.opened.append(self)

    @property
    def resolution_us(self):
        return self.step_us

    def set_pulse_us(self, channel, pulse_us):
        if self.cut:
            raise DriverIoError(121, "Remote I/O error")
        return super().set_pulse_us(channel, pulse_us)

    def release(self, channel):
        if self.cut:
            raise DriverIoError(121, "Remote I/O error")
        super().release(channel)


def unavailable(parameters):
    raise DriverUnavailableError("no such hardware here")


@pytest.fixture
def backends(monkeypatch):
    """Three more backends for the test: one, two, and one that is never there."""
    RecordingDriver.opened = []
    more = {name: Backend(name, RecordingParameters, RecordingDriver) for name in ("one", "two")}
    more["absent"] = Backend("absent", RecordingParameters, unavailable)
    monkeypatch.setattr(registry, "_BACKENDS", registry._BACKENDS | more)


STEPS = {"one": {"resolution_us": 1.0}, "two": {"resolution_us": 5.0}, "absent": {}}


def drivers(**chosen):
    return DriverSet(chosen, lambda backend: STEPS[backend.name])


def test_one_driver_of_each_backend(backends):
    made = drivers(pan_left="one", pan_right="one", tilt="two")
    assert len(RecordingDriver.opened) == 2
    assert made.by_joint["pan_left"] is made.by_joint["pan_right"]
    assert [driver.resolution_us for driver in made.by_joint.values()] == [1.0, 1.0, 5.0]
    assert made.joints("one") == ["pan_left", "pan_right"]
    assert made.description() == "one: pan_left, pan_right; two: tilt"
    assert drivers(pan_left="one").description() == "one"
    made.close()
    assert [driver.closed for driver in RecordingDriver.opened[:2]] == [True, True]


def test_where_one_cannot_be_opened_the_others_are_closed(backends):
    with pytest.raises(DriverUnavailableError, match="no such hardware"):
        drivers(pan_left="one", tilt="absent")
    assert [driver.closed for driver in RecordingDriver.opened] == [True]


def head_on(made, now_s=0.0):
    rig, wired = default_rig(), servos(tilt="two")
    limits = {name: servo_limits(name, wired[name], rig.joints[name]) for name in JOINTS}
    return ServoHead(made.by_joint, limits, HeadParameters(stagger_s=0.0), {}, now_s)


def run(head, seconds, command, start_s=0.0):
    for tick in range(round(seconds * 100)):
        now_s = start_s + tick / 100
        head.command(command, now_s)
        head.step(now_s)
    return start_s + seconds


def test_a_command_is_split_by_joint_and_each_keeps_its_limits_and_grid(backends):
    made = drivers(pan_left="one", pan_right="one", tilt="two")
    pans, tilt = RecordingDriver.opened
    head = head_on(made)
    run(head, 1.0, {"pan_left": 0.1, "pan_right": -0.1, "tilt": 9.0})
    assert pans.pulse_us(0) == pytest.approx(1564, abs=1)
    assert pans.pulse_us(1) == pytest.approx(1436, abs=1)
    assert tilt.pulse_us(0) == 2000.0  # 45 degrees by rig.yaml, on a grid of 5 us
    assert tilt.pulse_us(1) is None
    head.release(2.0)
    assert [pans.pulse_us(0), pans.pulse_us(1), tilt.pulse_us(0)] == [None] * 3


def test_a_backend_that_fails_stops_its_own_joints_only(backends):
    made = drivers(pan_left="one", pan_right="one", tilt="two")
    pans, tilt = RecordingDriver.opened
    head = head_on(made)
    command = {"pan_left": 0.1, "pan_right": 0.1, "tilt": 0.1}
    now_s = run(head, 1.0, command)
    tilt.cut = True
    run(head, 1.0, command | {"pan_left": -0.1, "tilt": 0.3}, now_s)
    assert head.channels["tilt"].state is ChannelState.FAILED
    assert pans.pulse_us(0) == pytest.approx(1436, abs=1)
