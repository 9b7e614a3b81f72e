"""The diagnostics of servo_node: the head, each servo, and the commands."""

from dataclasses import dataclass, field
from typing import Any

from vergence_rig.report import ERROR, OK, WARN, Report
from vergence_servo.driver_set import DriverSet
from vergence_servo.guardian import Guardians
from vergence_servo.servo_channel import ChannelState, ServoChannel
from vergence_servo.servo_head import Mode, ServoHead

_RECENT_S = 5.0


@dataclass
class CommandCounts:
    """Numbers of commands accepted and refused, by topic, and the last refusal."""

    accepted: dict[str, int] = field(default_factory=dict)
    refused: dict[str, int] = field(default_factory=dict)
    last_accepted_s: float | None = None
    last_refused_s: float | None = None
    last_reason: str = ""

    def accept(self, topic: str, now_s: float) -> None:
        """Count a command that was accepted."""
        self.accepted[topic] = self.accepted.get(topic, 0) + 1
        self.last_accepted_s = now_s

    def refuse(self, topic: str, reason: str, now_s: float) -> None:
        """Count a command that was refused."""
        self.refused[topic] = self.refused.get(topic, 0) + 1
        self.last_refused_s, self.last_reason = now_s, f"{topic}: {reason}"


def head_report(head: ServoHead, drivers: DriverSet, guardians: Guardians | None) -> Report:
    """Return the state of the head as a whole."""
    failed = [name for name, channel in head.channels.items() if channel.state is ChannelState.FAILED]
    values = {
        "mode": head.mode.value,
        "backend": drivers.description(),
        "resolution_us": ", ".join(f"{driver.resolution_us:.6g}" for driver in drivers.by_backend.values()),
        "outlives_process": any(driver.outlives_process for driver in drivers.by_backend.values()),
        "guardian": "none" if guardians is None else guardians.state,
    }
    if failed:
        return Report(ERROR, f"servos failed: {', '.join(failed)}", values)
    if values["guardian"] == "ended":
        return Report(
            WARN, "the guardian process has ended: a crash of servo_node would leave the servos pulsing", values
        )
    if head.mode is Mode.DISABLED:
        return Report(WARN, "the servos are disabled: call ~/enable with data: true", values)
    return Report(OK, head.mode.value, values)


def channel_report(channel: ServoChannel, now_s: float) -> Report:
    """Return the state of one servo."""
    limits = channel.limits
    values = {
        "state": channel.state.value,
        "pulse_us": "none" if channel.pulse_us is None else round(channel.pulse_us, 3),
        "sent_rad": channel.sent_rad,
        "lower_rad": limits.lower_rad,
        "upper_rad": limits.upper_rad,
        "max_speed_rad_s": limits.max_speed_rad_s,
        "faults": channel.fault_count,
    }
    if channel.state is ChannelState.FAILED:
        return Report(ERROR, f"{channel.fault}; next attempt in {max(channel.retry_s - now_s, 0.0):.1f} s", values)
    return Report(OK, channel.state.value, values)


def commands_report(counts: CommandCounts, conflict: str, now_s: float) -> Report:
    """Return which commands arrive, and whether two nodes publish commands at once."""
    values: dict[str, Any] = {f"accepted {topic}": count for topic, count in counts.accepted.items()}
    values |= {f"refused {topic}": count for topic, count in counts.refused.items()}
    values["age_s"] = "never" if counts.last_accepted_s is None else round(now_s - counts.last_accepted_s, 3)
    if counts.last_reason:
        values["last refusal"] = counts.last_reason
    if conflict:
        return Report(ERROR, conflict, values)
    if counts.last_refused_s is not None and now_s - counts.last_refused_s < _RECENT_S:
        return Report(WARN, f"refused: {counts.last_reason}", values)
    return Report(OK, "no command yet" if counts.last_accepted_s is None else "commands are accepted", values)
