"""What servo_node says of its own health, as plain values."""

from dataclasses import dataclass, field
from typing import Any

from vergence_servo.drivers.protocol import ServoDriver
from vergence_servo.guardian import Guardian
from vergence_servo.servo_channel import ChannelState, ServoChannel
from vergence_servo.servo_head import Mode, ServoHead

OK, WARN, ERROR = 0, 1, 2
_RECENT_S = 5.0


@dataclass
class CommandCounts:
    """Commands taken and refused, by topic, and the last refusal."""

    taken: dict[str, int] = field(default_factory=dict)
    refusals: dict[str, int] = field(default_factory=dict)
    last_taken_s: float | None = None
    last_refused_s: float | None = None
    last_reason: str = ""

    def accepted(self, topic: str, now_s: float) -> None:
        """Count one that was taken."""
        self.taken[topic] = self.taken.get(topic, 0) + 1
        self.last_taken_s = now_s

    def refused(self, topic: str, reason: str, now_s: float) -> None:
        """Count one that was refused."""
        self.refusals[topic] = self.refusals.get(topic, 0) + 1
        self.last_refused_s, self.last_reason = now_s, f"{topic}: {reason}"


@dataclass(frozen=True)
class Health:
    """Level (OK, WARN, ERROR), a sentence, and figures by name."""

    level: int
    message: str
    values: dict[str, Any]


def head_health(head: ServoHead, backend: str, driver: ServoDriver, guardian: Guardian | None) -> Health:
    """Return the state of the head as a whole."""
    failed = [name for name, channel in head.channels.items() if channel.state is ChannelState.FAILED]
    values = {
        "mode": head.mode.value,
        "backend": backend,
        "resolution_us": driver.resolution_us,
        "outlives_process": driver.outlives_process,
        "guardian": "none" if guardian is None else "waits" if guardian.alive else "gone",
    }
    if failed:
        return Health(ERROR, f"failed: {', '.join(failed)}", values)
    if guardian is not None and not guardian.alive:
        return Health(WARN, "the guardian process is gone: a crash would leave the servos pulsing", values)
    if head.mode is Mode.DISABLED:
        return Health(WARN, "disabled: call ~/enable", values)
    return Health(OK, head.mode.value, values)


def channel_health(channel: ServoChannel, now_s: float) -> Health:
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
        return Health(ERROR, f"{channel.fault}; next attempt in {max(channel.retry_s - now_s, 0.0):.1f} s", values)
    return Health(OK, channel.state.value, values)


def commands_health(counts: CommandCounts, conflict: str, now_s: float) -> Health:
    """Return what commands arrive, and whether two commanders contend."""
    values: dict[str, Any] = {f"taken {topic}": count for topic, count in counts.taken.items()}
    values |= {f"refused {topic}": count for topic, count in counts.refusals.items()}
    values["age_s"] = "never" if counts.last_taken_s is None else round(now_s - counts.last_taken_s, 3)
    if counts.last_reason:
        values["last refusal"] = counts.last_reason
    if conflict:
        return Health(ERROR, conflict, values)
    if counts.last_refused_s is not None and now_s - counts.last_refused_s < _RECENT_S:
        return Health(WARN, f"refused: {counts.last_reason}", values)
    return Health(OK, "none yet" if counts.last_taken_s is None else "commands are taken", values)
