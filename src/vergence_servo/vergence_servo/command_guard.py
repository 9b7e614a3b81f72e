"""Checks of commands: each is accepted or refused as a whole."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

_NS = 1_000_000_000


class CommandRefusedError(ValueError):
    """A command that is refused: the message says what must hold and what was given."""


class MalformedCommandError(CommandRefusedError):
    """Lists of different lengths, or a value that is not finite."""


class UnknownJointError(CommandRefusedError):
    """A joint that is not driven here."""


class StaleCommandError(CommandRefusedError):
    """A stamp too far from now, in either direction."""


class OutOfOrderError(CommandRefusedError):
    """A stamp older than the last command's."""


class DisabledError(CommandRefusedError):
    """The servos are disabled."""


@dataclass(frozen=True)
class StampLimits:
    """How far a stamp may be from now [s]; 0 disables the check. The last stamp is forgotten after `forget_s`."""

    max_age_s: float
    max_ahead_s: float
    forget_s: float


class StampGuard:
    """Refuses stale stamps and ones that run backwards. A stamp of 0 means that the sender does not stamp."""

    def __init__(self, limits: StampLimits) -> None:
        self._limits = limits
        self._last_ns = 0
        self._last_accepted_ns = 0

    def check(self, stamp_ns: int, now_ns: int) -> None:
        """Accept a stamp [ns, sender's clock] at `now_ns` [ns]; raise StaleCommandError or OutOfOrderError."""
        if stamp_ns == 0:
            return
        age_s = (now_ns - stamp_ns) / _NS
        limits = self._limits
        if limits.max_age_s > 0 and age_s > limits.max_age_s:
            raise StaleCommandError(
                f"stamp must be at most {limits.max_age_s:g} s old: got {age_s:.3f} s "
                f"(if the clocks differ: docs/two_machines.md)"
            )
        if limits.max_age_s > 0 and -age_s > limits.max_ahead_s:
            raise StaleCommandError(
                f"stamp must be at most {limits.max_ahead_s:g} s ahead: got {-age_s:.3f} s "
                f"(the clocks differ: docs/two_machines.md)"
            )
        # After a pause the last stamp no longer counts: a sender whose clock was set back is accepted again.
        recent = 0 <= now_ns - self._last_accepted_ns < limits.forget_s * _NS
        if recent and stamp_ns < self._last_ns:
            late_s = (self._last_ns - stamp_ns) / _NS
            raise OutOfOrderError(f"stamps must increase: got one {late_s:.3f} s before the last command's")
        self._last_ns, self._last_accepted_ns = stamp_ns, now_ns


def named_positions(names: Sequence[str], positions: Sequence[float], known: Sequence[str]) -> dict[str, float]:
    """Return positions [rad] by joint.

    Args:
        names: of the joints commanded, in any order, each once.
        positions: as many angles [rad].
        known: the joints that are driven.

    Raises:
        MalformedCommandError: no names, lengths that differ, a name twice, or a position that is not finite.
        UnknownJointError: a name that is not in `known`.
    """
    if len(names) == 0:
        raise MalformedCommandError("the command must name one or more of " + ", ".join(known) + ": got no joint")
    if len(positions) != len(names):
        raise MalformedCommandError(
            f"the command must have one position for each name: got {len(positions)} for {len(names)} names"
        )
    if len(set(names)) != len(names):
        raise MalformedCommandError(f"the command must name each joint once: got {', '.join(names)}")
    for name, position in zip(names, positions, strict=True):
        if name not in known:
            raise UnknownJointError(f"joint must be one of {', '.join(known)}: got {name[:60]!r}")
        if not math.isfinite(position):
            raise MalformedCommandError(f"position of {name!r} must be a finite angle [rad]: got {position}")
    return {name: float(position) for name, position in zip(names, positions, strict=True)}


def ordered_positions(positions: Sequence[float], known: Sequence[str]) -> dict[str, float]:
    """Return positions [rad] given in the order of `known`. Raises MalformedCommandError."""
    if len(positions) != len(known):
        raise MalformedCommandError(
            f"the command must have {len(known)} values, for {', '.join(known)}: got {len(positions)}"
        )
    return named_positions(known, positions, known)
