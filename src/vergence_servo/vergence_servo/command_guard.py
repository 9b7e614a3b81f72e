"""Which commands are taken: every one is checked as a whole, and taken or refused as a whole."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

_NS = 1_000_000_000


class CommandRefusedError(ValueError):
    """A command that is not taken: says what is wrong with it and what is allowed."""


class MalformedCommandError(CommandRefusedError):
    """Lengths that do not fit, or a value that is no number."""


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
    """How far a stamp may be from now [s]; 0 leaves stamps unchecked. `forget_s`: how long the last one counts."""

    max_age_s: float
    max_ahead_s: float
    forget_s: float


class StampGuard:
    """Refuses stale stamps and ones that run backwards. A stamp of 0 means that the sender does not stamp."""

    def __init__(self, limits: StampLimits) -> None:
        self._limits = limits
        self._last_ns = 0
        self._last_taken_ns = 0

    def check(self, stamp_ns: int, now_ns: int) -> None:
        """Take a stamp [ns, the sender's clock] at `now_ns` [ns, ours]; raise StaleCommandError or OutOfOrderError."""
        if stamp_ns == 0:
            return
        age_s = (now_ns - stamp_ns) / _NS
        limits = self._limits
        if limits.max_age_s > 0 and age_s > limits.max_age_s:
            raise StaleCommandError(
                f"stamp is {age_s:.3f} s old: allowed is {limits.max_age_s:g} s (or the clocks differ: "
                f"docs/two_machines.md)"
            )
        if limits.max_age_s > 0 and -age_s > limits.max_ahead_s:
            raise StaleCommandError(
                f"stamp is {-age_s:.3f} s ahead: allowed is {limits.max_ahead_s:g} s (the clocks differ: "
                f"docs/two_machines.md)"
            )
        # After a pause the last stamp no longer counts: a sender whose clock was set back is not locked out for ever.
        recent = 0 <= now_ns - self._last_taken_ns < limits.forget_s * _NS
        if recent and stamp_ns < self._last_ns:
            late_s = (self._last_ns - stamp_ns) / _NS
            raise OutOfOrderError(f"stamp is {late_s:.3f} s before the last command's: allowed is a rising stamp")
        self._last_ns, self._last_taken_ns = stamp_ns, now_ns


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
        raise MalformedCommandError("the command names no joint: allowed is any of " + ", ".join(known))
    if len(positions) != len(names):
        raise MalformedCommandError(f"{len(positions)} positions for {len(names)} names: allowed is one for each")
    if len(set(names)) != len(names):
        raise MalformedCommandError(f"names are {', '.join(names)}: allowed is each once")
    for name, position in zip(names, positions, strict=True):
        if name not in known:
            raise UnknownJointError(f"joint is {name[:60]!r}: allowed is one of {', '.join(known)}")
        if not math.isfinite(position):
            raise MalformedCommandError(f"position of {name!r} is {position}: allowed is a finite angle [rad]")
    return {name: float(position) for name, position in zip(names, positions, strict=True)}


def ordered_positions(positions: Sequence[float], known: Sequence[str]) -> dict[str, float]:
    """Return positions [rad] given in the order of `known`. Raises MalformedCommandError."""
    if len(positions) != len(known):
        raise MalformedCommandError(f"{len(positions)} values: allowed is {len(known)}, for {', '.join(known)}")
    return named_positions(known, positions, known)
