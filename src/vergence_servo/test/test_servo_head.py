"""The head as a whole on the shipped fake: time-outs, staggered starts, parking, faults, and hostile commands."""

import itertools
import math
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vergence_rig.parameters import ParameterError
from vergence_rig.rig import default_rig
from vergence_servo.calibration import default_servos, servo_limits
from vergence_servo.command_guard import CommandRefusedError, DisabledError, UnknownJointError
from vergence_servo.drivers.fake import FakeDriver, FakeParameters
from vergence_servo.drivers.protocol import DriverIoError
from vergence_servo.servo_channel import ChannelState, RetryParameters
from vergence_servo.servo_head import HeadParameters, Mode, ServoHead
from vergence_servo.trajectory import Trajectory, TrajectoryPoint

TICK_S = 0.01


class Wires(FakeDriver):
    """The shipped fake on a settable clock, with a record of every write, and channels that may be cut."""

    def __init__(self, resolution_us: float = 1.0) -> None:
        self.now_s = 100.0
        super().__init__(FakeParameters(resolution_us=resolution_us), clock=lambda: self.now_s)
        self.written: list[tuple[float, int, float]] = []
        self.cut: set[int] = set()
        self.attempts = 0

    def set_pulse_us(self, channel: int, pulse_us: float) -> float:
        self.attempts += 1
        if channel in self.cut:
            raise DriverIoError(121, "Remote I/O error")
        self.written.append((self.now_s, channel, pulse_us))
        return super().set_pulse_us(channel, pulse_us)

    def release(self, channel: int) -> None:
        if channel in self.cut:
            raise DriverIoError(121, "Remote I/O error")
        super().release(channel)


class Bench:
    """A head on wires, moved on by hand."""

    def __init__(
        self,
        resolution_us: float = 1.0,
        initial_rad: dict[str, float] | None = None,
        retry: RetryParameters | None = None,
        **changes: Any,
    ):
        rig = default_rig()
        self.limits = {name: servo_limits(name, servo, rig.joints[name]) for name, servo in default_servos().items()}
        self.wires = Wires(resolution_us)
        self.head = ServoHead(
            self.wires, self.limits, HeadParameters(**changes), initial_rad or {}, self.wires.now_s, retry
        )

    def run(self, duration_s: float) -> None:
        for _ in range(round(duration_s / TICK_S)):
            self.wires.now_s += TICK_S
            self.head.step(self.wires.now_s)

    def command(self, **positions_rad: float) -> None:
        self.head.command(positions_rad, self.wires.now_s)

    def keep(self, duration_s: float, **positions_rad: float) -> None:
        """Command the same again and again, as a controller does."""
        for _ in range(round(duration_s / TICK_S)):
            self.command(**positions_rad)
            self.run(TICK_S)

    def state(self, name: str) -> ChannelState:
        return self.head.channels[name].state

    def mode(self) -> Mode:
        return self.head.mode

    def under_way(self) -> bool:
        return self.head.under_way

    def pulse_us(self, name: str) -> float | None:
        return self.wires.pulse_us(self.limits[name].calibration.channel)


def test_nothing_pulses_before_the_first_command():
    bench = Bench()
    bench.run(1.0)
    assert bench.wires.written == []
    assert bench.mode() is Mode.RELEASED


def test_a_command_is_followed_and_held():
    bench = Bench()
    bench.keep(1.0, pan_left=0.3, tilt=-0.2)
    assert bench.pulse_us("pan_left") == pytest.approx(1500 + math.degrees(0.3) / 0.09, abs=0.5)
    assert bench.pulse_us("pan_right") is None
    assert bench.head.positions_rad(bench.wires.now_s)["tilt"] == pytest.approx(-0.2, abs=1e-3)


def test_servos_start_one_after_the_other():
    bench = Bench(stagger_s=0.2)
    bench.keep(1.0, pan_left=0.0, pan_right=0.0, tilt=0.0)
    firsts = [min(t for t, channel, _ in bench.wires.written if channel == number) for number in range(3)]
    assert [later - earlier for earlier, later in itertools.pairwise(firsts)] == pytest.approx([0.2, 0.2])


def test_the_first_pulse_is_where_the_servo_is_initial_to_be():
    bench = Bench(initial_rad={"pan_left": 0.5})
    bench.keep(0.5, pan_left=-0.5)
    assert bench.wires.written[0][2] == pytest.approx(1500 + math.degrees(0.5) / 0.09, abs=0.5)


def test_silence_holds_then_releases_and_a_command_resumes():
    bench = Bench(command_timeout_s=0.3, release_timeout_s=1.0)
    bench.keep(0.1, pan_left=1.0)
    bench.run(0.35)
    assert bench.mode() is Mode.HOLDING
    held_us = bench.pulse_us("pan_left")
    bench.run(0.5)
    assert bench.pulse_us("pan_left") == held_us
    bench.run(0.6)
    assert bench.mode() is Mode.RELEASED
    assert bench.pulse_us("pan_left") is None
    bench.command(pan_left=0.2)
    bench.run(0.2)
    assert bench.pulse_us("pan_left") == pytest.approx(1500 + math.degrees(0.2) / 0.09, abs=0.5)


def test_holding_stops_a_move_half_way():
    bench = Bench(command_timeout_s=0.05, release_timeout_s=0.0)
    bench.keep(0.02, pan_left=0.0)
    bench.command(pan_left=1.0)
    bench.run(0.05)  # at 600 degrees per second the move would take 0.1 s
    bench.run(100.0)
    assert 1550 < (bench.pulse_us("pan_left") or 0) < 2100
    assert bench.mode() is Mode.HOLDING


def test_a_trajectory_is_followed_beyond_the_command_time_out():
    bench = Bench(command_timeout_s=0.2)
    points = [TrajectoryPoint(1.0, (0.4,)), TrajectoryPoint(2.0, (0.0,))]
    trajectory = Trajectory(["tilt"], points, bench.head.sent_rad())
    bench.head.follow(trajectory, bench.wires.now_s, bench.wires.now_s)
    bench.run(1.0)
    assert bench.head.sent_rad()["tilt"] == pytest.approx(0.4, abs=0.01)
    bench.run(0.5)
    assert bench.head.sent_rad()["tilt"] == pytest.approx(0.2, abs=0.01)
    bench.run(1.0)
    assert bench.mode() is Mode.HOLDING
    with pytest.raises(CommandRefusedError, match="ended"):
        bench.head.follow(trajectory, bench.wires.now_s - 10.0, bench.wires.now_s)


def test_disabling_releases_and_refuses():
    bench = Bench()
    bench.keep(0.5, pan_left=0.1)
    bench.head.enable(False, bench.wires.now_s)
    assert not bench.head.pulsing
    with pytest.raises(DisabledError):
        bench.command(pan_left=0.2)
    with pytest.raises(DisabledError):
        bench.head.park(bench.wires.now_s)
    bench.head.release(bench.wires.now_s)
    assert bench.mode() is Mode.DISABLED
    bench.head.enable(True, bench.wires.now_s)
    bench.command(pan_left=0.2)


def test_parking_is_slow_ends_at_the_pose_and_holds():
    bench = Bench(park_rad=(0.1, -0.1, 0.2), park_speed_rad_s=0.5)
    bench.keep(0.5, pan_left=0.6)
    bench.head.park(bench.wires.now_s)
    before_rad = bench.head.sent_rad()["pan_left"]
    bench.run(0.5)
    assert bench.head.sent_rad()["pan_left"] == pytest.approx(before_rad - 0.25, abs=0.01)
    assert bench.mode() is Mode.PARKING
    bench.run(1.0)
    assert bench.mode() is Mode.HOLDING
    assert [round(value, 2) for value in bench.head.sent_rad().values()] == [0.1, -0.1, 0.2]


def test_parking_at_the_end_leaves_limp_servos_limp():
    bench = Bench()
    bench.keep(0.5, pan_left=0.6)
    bench.head.park(bench.wires.now_s, only_pulsing=True)
    bench.run(1.5)
    assert bench.head.parked
    assert bench.pulse_us("tilt") is None


def test_a_failed_channel_stops_alone_and_is_tried_again_less_and_less_often():
    bench = Bench(retry=RetryParameters(first_s=0.5, longest_s=2.0), stagger_s=0.0)
    bench.keep(0.5, pan_left=0.1, tilt=0.1)
    bench.wires.cut = {0}
    bench.keep(0.1, pan_left=0.2, tilt=0.2)
    channel = bench.head.channels["pan_left"]
    assert bench.state("pan_left") is ChannelState.FAILED
    assert "Remote I/O" in channel.fault
    assert bench.head.sent_rad()["tilt"] == pytest.approx(0.2, abs=0.01)
    before = bench.wires.attempts
    bench.keep(10.0, pan_left=0.2, tilt=0.2)
    assert 4 <= bench.wires.attempts - before <= 7  # after 0.5, 1, 2, 2, 2 s
    bench.wires.cut = set()
    bench.keep(2.5, pan_left=0.2, tilt=0.2)
    assert bench.state("pan_left") is ChannelState.PULSING
    assert channel.fault == ""
    assert channel.sent_rad == pytest.approx(0.2, abs=0.01)


def test_a_release_that_fails_is_repeated_until_it_holds():
    bench = Bench(retry=RetryParameters(first_s=0.2))
    bench.keep(0.5, pan_left=0.1)
    bench.wires.cut = {0}
    bench.head.release(bench.wires.now_s)
    assert bench.state("pan_left") is ChannelState.FAILED
    assert bench.pulse_us("pan_left") is not None
    bench.run(0.5)
    bench.wires.cut = set()
    bench.run(1.0)
    assert bench.state("pan_left") is ChannelState.RELEASED
    assert bench.pulse_us("pan_left") is None


def test_channels_left_pulsing_by_a_dead_process_are_released_at_the_start():
    wires = Wires()
    wires.set_pulse_us(1, 1500.0)
    rig = default_rig()
    limits = {name: servo_limits(name, servo, rig.joints[name]) for name, servo in default_servos().items()}
    ServoHead(wires, limits, HeadParameters(), {}, wires.now_s)
    assert wires.pulse_us(1) is None


def test_unknown_joints_and_poses_that_do_not_fit_are_refused():
    with pytest.raises(UnknownJointError):
        Bench().command(neck=0.1)
    with pytest.raises(ParameterError, match="park_rad"):
        Bench(park_rad=(0.0, 0.0))
    with pytest.raises(ParameterError, match="longest_s"):
        RetryParameters(first_s=2.0, longest_s=1.0)


@settings(deadline=None, max_examples=60)
@given(
    acts=st.lists(
        st.tuples(
            st.sampled_from(["command", "command", "command", "park", "release", "hold", "disable", "enable", "cut"]),
            st.dictionaries(st.sampled_from(["pan_left", "pan_right", "tilt", "nose"]), st.floats()),
            st.floats(-0.05, 0.4),
        ),
        max_size=40,
    ),
    initial=st.dictionaries(st.sampled_from(["pan_left", "tilt"]), st.floats(-9, 9)),
    resolution_us=st.sampled_from([0.02, 1.0, 4.88, 5.0]),
)
def test_no_history_makes_the_head_send_an_unsafe_pulse(
    acts: list[tuple[str, dict[str, float], float]], initial: dict[str, float], resolution_us: float
):
    bench = Bench(resolution_us, initial, RetryParameters(first_s=0.05), stagger_s=0.02, release_timeout_s=0.3)
    head, wires = bench.head, bench.wires
    for act, positions, pause_s in acts:
        wires.now_s += pause_s  # clocks may even step back
        wires.cut = {1} if act == "cut" else set()
        try:
            if act == "command":
                head.command(positions, wires.now_s)
            elif act in ("park", "release", "hold"):
                getattr(head, act)(wires.now_s)
            else:
                head.enable(act != "disable", wires.now_s)
        except CommandRefusedError:
            pass
        for _ in range(3):
            wires.now_s += 0.004
            head.step(wires.now_s)
    last: dict[int, tuple[float, float]] = {}
    for at_s, channel, pulse_us in wires.written:
        limits = next(limits for limits in bench.limits.values() if limits.calibration.channel == channel)
        assert limits.minimum_us <= pulse_us <= limits.maximum_us
        if channel in last:
            before_s, before_us = last[channel]
            way_rad = abs(limits.calibration.joint_rad(pulse_us) - limits.calibration.joint_rad(before_us))
            assert way_rad <= limits.max_speed_rad_s * max(at_s - before_s, 0.0) + 1e-9
        last[channel] = (at_s, pulse_us)


@settings(deadline=None, max_examples=60)
@given(
    commands=st.lists(
        st.dictionaries(st.sampled_from(["pan_left", "pan_right", "tilt"]), st.floats(-1.5, 1.5), min_size=1),
        min_size=1,
        max_size=5,
    ),
    resolution_us=st.sampled_from([0.02, 1.0, 4.88, 5.0]),
    steps=st.integers(0, 30),
)
def test_a_head_that_is_not_under_way_sends_nothing_until_the_next_command(
    commands: list[dict[str, float]], resolution_us: float, steps: int
):
    bench = Bench(resolution_us, command_timeout_s=60.0, stagger_s=0.02)
    for positions_rad in commands:
        bench.command(**positions_rad)
        bench.run(steps * TICK_S)
        sent = len(bench.wires.written)
        if not bench.under_way():
            bench.run(0.5)
            assert len(bench.wires.written) == sent
    bench.run(5.0)
    assert not bench.under_way()


def test_a_trajectory_and_parking_are_under_way_to_their_end():
    bench = Bench(command_timeout_s=0.2)
    bench.head.follow(
        Trajectory(["pan_left"], [TrajectoryPoint(1.0, (0.5,), None)], bench.head.sent_rad()), 100.0, 100.0
    )
    bench.run(0.9)
    assert bench.under_way()
    bench.run(0.5)
    assert not bench.under_way()
    bench.head.park(bench.wires.now_s)
    assert bench.under_way()
    bench.run(2.0)
    assert not bench.under_way()
