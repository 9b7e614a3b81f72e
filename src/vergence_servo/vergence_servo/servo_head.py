"""All servos of a head: commands, time-outs, parking and staggered starts. Time is the caller's monotonic clock [s]."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

from vergence_rig.parameters import ParameterError, Parameters, parameter
from vergence_servo.calibration import ServoLimits
from vergence_servo.command_guard import CommandRefusedError, DisabledError, UnknownJointError
from vergence_servo.drivers.protocol import ServoDriver
from vergence_servo.servo_channel import ChannelState, RetryParameters, ServoChannel
from vergence_servo.trajectory import Trajectory


class Mode(Enum):
    """The state of the head."""

    DISABLED = "disabled"
    RELEASED = "released"
    COMMANDED = "commanded"
    HOLDING = "holding"
    PARKING = "parking"


@dataclass(frozen=True)
class HeadParameters(Parameters):
    """Time-outs, starts and parking."""

    command_timeout_s: float = parameter(
        0.5, "without a command for this long the servos hold their position", unit="s", minimum=0.01, maximum=3600
    )
    release_timeout_s: float = parameter(
        30.0,
        "servos that have held for this long are released; 0 never releases them",
        unit="s",
        minimum=0,
        maximum=86400,
    )
    stagger_s: float = parameter(
        0.15,
        "time between the first pulses of two servos, which limits the inrush current",
        unit="s",
        minimum=0,
        maximum=10,
    )
    park_rad: tuple[float, ...] = parameter(
        (0.0, 0.0, 0.0),
        "angles of the parking pose, in the order of `joints`",
        unit="rad",
        minimum=-math.pi,
        maximum=math.pi,
    )
    park_speed_rad_s: float = parameter(
        1.5, "speed at which servos move to the parking pose", unit="rad/s", minimum=0.05, maximum=100
    )
    park_time_limit_s: float = parameter(
        2.0,
        "longest time of parking on SIGINT and SIGTERM, after which all servos are released",
        unit="s",
        minimum=0,
        maximum=30,
    )
    command_latency_s: float = parameter(
        0.015,
        "modelled time from a pulse to the servo's first motion, used for joint_states",
        unit="s",
        minimum=0,
        maximum=1,
    )


class ServoHead:
    """Drives the channels towards the commanded angles, one `step` at a time; only safe pulses reach the driver."""

    def __init__(
        self,
        driver: ServoDriver | Mapping[str, ServoDriver],
        servos: Mapping[str, ServoLimits],
        parameters: HeadParameters,
        initial_rad: Mapping[str, float],
        now_s: float,
        retry: RetryParameters | None = None,
    ) -> None:
        """Release all servos.

        Args:
            driver: the backend, or one for each joint.
            servos: limits by joint; their order is that of `park_rad`.
            parameters: time-outs, starts and parking.
            initial_rad: estimated angles of the joints; 0 for those left out.
            now_s: the time.
            retry: waits before a failed channel is tried again.
        """
        if len(parameters.park_rad) != len(servos):
            raise ParameterError(
                "park_rad", parameters.park_rad, f"a list of {len(servos)} angles, for {', '.join(servos)}"
            )
        self._parameters = parameters
        retry = retry or RetryParameters()
        drivers = driver if isinstance(driver, Mapping) else dict.fromkeys(servos, driver)
        self.channels = {
            name: ServoChannel(
                name,
                limits,
                limits.calibration.servo_spec(drivers[name].resolution_us, parameters.command_latency_s),
                drivers[name],
                initial_rad.get(name, 0.0),
                retry,
                now_s,
            )
            for name, limits in servos.items()
        }
        self.mode = Mode.RELEASED
        self._wanted_rad: dict[str, float] = {}
        self._trajectory: tuple[Trajectory, float] | None = None
        self._commanded_s = now_s
        self._next_start_s = now_s
        for channel in self.channels.values():
            channel.release(now_s)  # a killed process may have left it pulsing

    def set_parameters(self, parameters: HeadParameters, retry: RetryParameters) -> None:
        """Use other time-outs and waits from now on."""
        self._parameters = parameters
        for channel in self.channels.values():
            channel.retry = retry

    def command(self, positions_rad: Mapping[str, float], now_s: float) -> None:
        """Move these joints to these angles [rad]; ends a trajectory. Raises CommandRefusedError."""
        self._check_enabled()
        for name in positions_rad:
            if name not in self.channels:
                raise UnknownJointError(f"joint must be one of {', '.join(self.channels)}: got {name[:60]!r}")
        self._trajectory = None
        self._begin(now_s)
        self._wanted_rad.update(positions_rad)

    def follow(self, trajectory: Trajectory, begin_s: float, now_s: float) -> None:
        """Follow a trajectory that begins at `begin_s`. Raises CommandRefusedError where it lies wholly in the past."""
        self._check_enabled()
        if begin_s + trajectory.duration_s < now_s - self._parameters.command_timeout_s:
            raise CommandRefusedError(f"the trajectory ended {now_s - begin_s - trajectory.duration_s:.3f} s ago")
        self._begin(now_s)
        self._trajectory = (trajectory, begin_s)

    def hold(self, now_s: float) -> None:
        """Stop where the servos are and keep them there."""
        self._trajectory = None
        self._wanted_rad = {name: self.channels[name].sent_rad for name in self._wanted_rad}
        self.mode = Mode.HOLDING
        self._commanded_s = now_s

    def enable(self, on: bool, now_s: float) -> None:
        """Accept commands again, or release everything and refuse them."""
        if not on:
            self._release_all(now_s, Mode.DISABLED)
        elif self.mode is Mode.DISABLED:
            self.mode = Mode.RELEASED

    def release(self, now_s: float) -> None:
        """Release every servo; the next command starts them again."""
        self._release_all(now_s, Mode.DISABLED if self.mode is Mode.DISABLED else Mode.RELEASED)

    def park(self, now_s: float, only_pulsing: bool = False) -> None:
        """Go slowly to the parking pose and hold there; `only_pulsing` skips released ones. Raises DisabledError."""
        self._check_enabled()
        self._trajectory = None
        self._wanted_rad = {
            name: goal
            for (name, channel), goal in zip(self.channels.items(), self._parameters.park_rad, strict=True)
            if channel.state is ChannelState.PULSING or not only_pulsing
        }
        self.mode = Mode.PARKING
        self._commanded_s = now_s

    def attach_all(self, now_s: float) -> None:
        """Begin to hold every servo at its estimated position. Raises DisabledError."""
        self._check_enabled()
        self._wanted_rad = {name: channel.sent_rad for name, channel in self.channels.items()}
        self.hold(now_s)

    @property
    def trajectory(self) -> Trajectory | None:
        """The trajectory that is followed; None if there is none."""
        return None if self._trajectory is None else self._trajectory[0]

    @property
    def parked(self) -> bool:
        """True if every commanded servo that works has been sent to its commanded angle."""
        commanded = [(self.channels[name], wanted) for name, wanted in self._wanted_rad.items()]
        return all(channel.state is ChannelState.FAILED or channel.arrived(wanted) for channel, wanted in commanded)

    @property
    def under_way(self) -> bool:
        """True while the next step may send something else than the last one, without another command."""
        if self._trajectory is not None or self.mode is Mode.PARKING:
            return True
        return any(self.channels[name].under_way(wanted_rad) for name, wanted_rad in self._wanted_rad.items())

    @property
    def at_rest(self) -> bool:
        """True if every modelled position stays as it is until another command."""
        return not self.under_way and all(channel.at_rest for channel in self.channels.values())

    @property
    def pulsing(self) -> bool:
        """True if any servo gets pulses."""
        return any(channel.state is ChannelState.PULSING for channel in self.channels.values())

    def step(self, now_s: float) -> None:
        """Send what is due."""
        self._time_out(now_s)
        self._sample(now_s)
        for name, channel in self.channels.items():
            if channel.state is ChannelState.FAILED:
                self._retry(channel, now_s)
            elif name in self._wanted_rad and channel.state is ChannelState.RELEASED:
                self._start(channel, now_s)
            if name in self._wanted_rad:
                speed = self._parameters.park_speed_rad_s if self.mode is Mode.PARKING else math.inf
                channel.drive(self._wanted_rad[name], now_s, speed)
        if self.mode is Mode.PARKING and self.parked:
            self.hold(now_s)

    def positions_rad(self, now_s: float) -> dict[str, float]:
        """Return the modelled position of every joint [rad]."""
        return {name: channel.modelled_rad(now_s) for name, channel in self.channels.items()}

    def sent_rad(self) -> dict[str, float]:
        """Return the angle last sent to every joint [rad]."""
        return {name: channel.sent_rad for name, channel in self.channels.items()}

    def _check_enabled(self) -> None:
        if self.mode is Mode.DISABLED:
            raise DisabledError("the servos are disabled: call ~/enable with data: true")

    def _begin(self, now_s: float) -> None:
        self.mode = Mode.COMMANDED
        self._commanded_s = now_s

    def _time_out(self, now_s: float) -> None:
        values = self._parameters
        if self.mode is Mode.COMMANDED:
            last_s = self._commanded_s
            if self._trajectory is not None:
                last_s = max(last_s, self._trajectory[1] + self._trajectory[0].duration_s)
            if now_s - last_s > values.command_timeout_s:
                self.hold(now_s)
        elif self.mode is Mode.HOLDING and 0 < values.release_timeout_s < now_s - self._commanded_s:
            self._release_all(now_s, Mode.RELEASED)

    def _sample(self, now_s: float) -> None:
        if self._trajectory is not None:
            trajectory, begin_s = self._trajectory
            self._wanted_rad.update(trajectory.positions_rad(now_s - begin_s))

    def _start(self, channel: ServoChannel, now_s: float) -> None:
        if now_s >= self._next_start_s:
            self._next_start_s = now_s + self._parameters.stagger_s
            channel.attach(now_s)

    def _retry(self, channel: ServoChannel, now_s: float) -> None:
        if now_s < channel.retry_s:
            return
        if channel.name in self._wanted_rad:
            self._start(channel, now_s)
        else:
            channel.release(now_s)

    def _release_all(self, now_s: float, mode: Mode) -> None:
        self._trajectory = None
        self._wanted_rad = {}
        self.mode = mode
        for channel in self.channels.values():
            if channel.state is not ChannelState.RELEASED:
                channel.release(now_s)
