"""What a staircase of commands and the angles seen after each tell: gain, and the motion lost at every turn.

A staircase up and down gives a loop: seen = gain * told + constant -+ half the lost motion, behind on the side it came
from. Dead band and backlash both lose motion when the direction changes, and at rest nothing tells one from the other:
what is seen is their sum.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

LEAST_SAMPLES = 8


class LoopError(ValueError):
    """A staircase that tells nothing."""


@dataclass(frozen=True)
class Loop:
    """Signed gain (seen per told), lost motion and residual in units of what was seen, and standard deviations."""

    gain: float
    gain_sigma: float
    lost: float
    lost_sigma: float
    residual: float
    samples: int


def staircase(amplitude_rad: float, steps: int, loops: int) -> list[float]:
    """Return joint angles about 0 [rad]: down to -amplitude, then up and down in `steps` steps each way, and back."""
    up = np.linspace(-amplitude_rad, amplitude_rad, steps + 1)
    loop = [*up[1:], *up[-2::-1]]
    return [float(angle) for angle in [up[0], *(loop * loops), 0.0]]


def fit_loop(told: Sequence[float] | Array, seen: Sequence[float] | Array) -> Loop:
    """Return the loop of what was told, in order, and what was seen after each.

    Args:
        told: at least 8, with moves in both directions.
        seen: as many; only their differences count.

    Raises:
        LoopError: too few, none in one of the directions, or moves that are lost in the play.
    """
    x, y = np.asarray(told, float), np.asarray(seen, float)
    if len(x) != len(y) or len(x) < LEAST_SAMPLES or not (np.isfinite(x).all() and np.isfinite(y).all()):
        raise LoopError(f"{len(x)} commands and {len(y)} angles: allowed are {LEAST_SAMPLES} or more pairs")
    direction = np.sign(np.diff(x, prepend=x[0]))
    since_turn = _travel_since_turn(x)
    gain, lost = 0.0, 0.0
    for _ in range(3):
        # the first moves after a turn are spent on the lost motion: they say nothing of the gain
        usable = (direction != 0) & (since_turn > 1.1 * lost / max(abs(gain), 1e-12))
        if usable.sum() < LEAST_SAMPLES or len(set(direction[usable])) < 2:
            raise LoopError("the moves are too small for this servo's lost motion: make them larger")
        terms = np.column_stack([x - x.mean(), np.ones_like(x), direction])[usable]
        (gain, _, lag), *_ = np.linalg.lstsq(terms, y[usable], rcond=None)
        lost = max(-2.0 * lag * np.sign(gain), 0.0)
    count = int(usable.sum())
    misfit = y[usable] - terms @ np.linalg.lstsq(terms, y[usable], rcond=None)[0]
    spread = np.sqrt(np.diag(np.linalg.pinv(terms.T @ terms)) * (misfit @ misfit) / max(count - 3, 1))
    return Loop(
        gain=float(gain),
        gain_sigma=float(spread[0]),
        lost=float(lost),
        lost_sigma=float(2.0 * spread[2]),
        residual=float(np.sqrt(np.mean(misfit**2))),
        samples=count,
    )


def _travel_since_turn(told: Array) -> Array:
    travel = np.zeros_like(told)
    start = told[0]
    for i in range(1, len(told)):
        if i > 1 and (told[i] - told[i - 1]) * (told[i - 1] - told[i - 2]) < 0:
            start = told[i - 1]
        travel[i] = abs(told[i] - start)
    # before the first turn nobody knows where the gears lie
    turns = [i for i in range(2, len(told)) if (told[i] - told[i - 1]) * (told[i - 1] - told[i - 2]) < 0]
    travel[: turns[0] if turns else len(told)] = 0.0
    return travel
