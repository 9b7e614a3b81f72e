"""One servo on one channel: released, pulsing or failed, and its estimated position."""

from dataclasses import dataclass
from enum import Enum

from vergence_rig.parameters import ParameterError, Parameters, parameter
from vergence_rig.servo import ServoPlant, ServoSpec
from vergence_servo.calibration import ServoLimits
from vergence_servo.drivers.protocol import DriverIoError, ServoDriver
from vergence_servo.safety import safe_pulse_us


class ChannelState(Enum):
    """The state of a channel."""

    RELEASED = "released"
    PULSING = "pulsing"
    FAILED = "failed"


@dataclass(frozen=True)
class RetryParameters(Parameters):
    """Waits between attempts at a failed channel: doubling from the first to the longest."""

    first_s: float = parameter(
        0.5,
        "wait before a failed servo channel is tried again; it doubles with every failure",
        unit="s",
        minimum=0.01,
        maximum=60,
        formerly="retry_first_s",
    )
    longest_s: float = parameter(
        30.0,
        "longest wait before a failed servo channel is tried again",
        unit="s",
        minimum=0.01,
        maximum=3600,
        formerly="retry_longest_s",
    )

    def check(self) -> None:
        """See Parameters."""
        if self.longest_s < self.first_s:
            raise ParameterError("longest_s", self.longest_s, f"at least first_s, {self.first_s:g}")


class ServoChannel:
    """Sends pulses through `safe_pulse_us` alone, and stops, reports and retries where the backend fails."""

    def __init__(
        self,
        name: str,
        limits: ServoLimits,
        spec: ServoSpec,
        driver: ServoDriver,
        initial_rad: float,
        retry: RetryParameters,
        now_s: float,
    ) -> None:
        self.name = name
        self.limits = limits
        self.retry = retry
        self.state = ChannelState.RELEASED
        self.fault = ""
        self.fault_count = 0
        self.retry_s = 0.0
        self._driver = driver
        self._channel = limits.calibration.channel
        self._wait_s = retry.first_s
        self._pulse_us = safe_pulse_us(
            initial_rad, limits.calibration.pulse_us(initial_rad), 0.0, limits, driver.resolution_us
        )
        self._sent_s = now_s
        self._working_since_s = now_s
        self._plant = ServoPlant(spec, self.sent_rad, now_s)

    @property
    def sent_rad(self) -> float:
        """The joint angle of the pulse sent last, or the initial one before the first [rad]."""
        return self.limits.calibration.joint_rad(self._pulse_us)

    @property
    def pulse_us(self) -> float | None:
        """The pulse being sent [us]; None where there is none."""
        return self._pulse_us if self.state is ChannelState.PULSING else None

    def modelled_rad(self, now_s: float) -> float:
        """Return the modelled position [rad]: hobby servos do not report theirs."""
        self._plant.step(now_s)
        return self._plant.modelled_rad

    @property
    def at_rest(self) -> bool:
        """True if the modelled position stays as it is until another pulse is sent."""
        return self._plant.at_rest

    def attach(self, now_s: float) -> None:
        """Begin to send pulses, at the estimated position."""
        self._send(self._pulse_us, now_s)

    def drive(self, wanted_rad: float, now_s: float, speed_rad_s: float) -> None:
        """Send what is safe on the way to `wanted_rad` [rad]. A channel that does not pulse stays as it is."""
        if self.state is not ChannelState.PULSING:
            return
        pulse_us = safe_pulse_us(
            wanted_rad, self._pulse_us, now_s - self._sent_s, self.limits, self._driver.resolution_us, speed_rad_s
        )
        if pulse_us != self._pulse_us:
            self._send(pulse_us, now_s)
        elif now_s - self._working_since_s > self._wait_s:
            self._wait_s = self.retry.first_s

    def under_way(self, wanted_rad: float) -> bool:
        """Return whether it is yet to start, or to send more pulses on the way to `wanted_rad` [rad]; failed: no."""
        if self.state is not ChannelState.PULSING:
            return self.state is ChannelState.RELEASED
        return self._goal_us(wanted_rad) != self._pulse_us

    def arrived(self, wanted_rad: float) -> bool:
        """Return whether the pulse sent is the one nearest to `wanted_rad` [rad] that may be sent."""
        goal_us = self._goal_us(wanted_rad)
        near_us = 1.001 * self._driver.resolution_us
        return abs(goal_us - self._pulse_us) <= near_us and abs(self._way_us(wanted_rad)) <= near_us

    def release(self, now_s: float) -> None:
        """Stop the pulses. Where even that fails the channel is FAILED, and released again later."""
        try:
            self._driver.release(self._channel)
        except DriverIoError as error:
            self._failed(error, now_s)
            return
        self.state = ChannelState.RELEASED

    def _goal_us(self, wanted_rad: float) -> float:
        """Return the pulse that would be sent if the servo could travel for as long as it needs."""
        return safe_pulse_us(wanted_rad, self._pulse_us, 1e9, self.limits, self._driver.resolution_us)

    def _way_us(self, wanted_rad: float) -> float:
        wanted_us = self.limits.calibration.pulse_us(wanted_rad)
        return min(max(wanted_us, self.limits.minimum_us), self.limits.maximum_us) - self._pulse_us

    def _send(self, pulse_us: float, now_s: float) -> None:
        try:
            self._driver.set_pulse_us(self._channel, pulse_us)
        except DriverIoError as error:
            self._failed(error, now_s)
            try:
                self._driver.release(self._channel)
            except DriverIoError:
                return  # release is tried again with the next attempt
            return
        if self.state is not ChannelState.PULSING:
            self._working_since_s = now_s
            self.fault = ""
        self.state = ChannelState.PULSING
        self._pulse_us, self._sent_s = pulse_us, now_s
        self._plant.command(self.sent_rad, now_s)

    def _failed(self, error: DriverIoError, now_s: float) -> None:
        self.state = ChannelState.FAILED
        self.fault = str(error)
        self.fault_count += 1
        self.retry_s = now_s + self._wait_s
        self._wait_s = min(2 * self._wait_s, self.retry.longest_s)
