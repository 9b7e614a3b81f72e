"""Gain and lost motion of an axis, from a staircase of commands and the angles seen after each.

A staircase up and down gives a hysteresis loop: seen = gain * commanded + constant -+ half the lost motion, lagging in
both directions. Dead band and backlash both lose motion when the direction changes; at rest only their sum can be
measured.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

LEAST_SAMPLES = 8


class LoopError(ValueError):
    """A staircase from which no loop can be estimated."""


@dataclass(frozen=True)
class Loop:
    """Signed gain (seen per commanded), lost motion and residual in units of what was seen, and standard deviations."""

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


def fit_loop(commanded: Sequence[float] | Array, seen: Sequence[float] | Array) -> Loop:
    """Return the loop of commanded values, in order, and the values seen after each.

    Args:
        commanded: at least 8, with moves in both directions.
        seen: as many; only their differences count.

    Raises:
        LoopError: too few, none in one of the directions, or moves smaller than the lost motion.
    """
    x, y = np.asarray(commanded, float), np.asarray(seen, float)
    if len(x) != len(y) or len(x) < LEAST_SAMPLES or not (np.isfinite(x).all() and np.isfinite(y).all()):
        raise LoopError(
            f"there must be {LEAST_SAMPLES} or more pairs of command and angle: got {len(x)} commands, {len(y)} angles"
        )
    direction = np.sign(np.diff(x, prepend=x[0]))
    since_reversal = _travel_since_reversal(x)
    gain, lost = 0.0, 0.0
    for _ in range(3):
        # the first moves after a reversal only cross the lost motion: they carry no information on the gain
        usable = (direction != 0) & (since_reversal > 1.1 * lost / max(abs(gain), 1e-12))
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


def _travel_since_reversal(commanded: Array) -> Array:
    travel = np.zeros_like(commanded)
    start = commanded[0]
    for i in range(1, len(commanded)):
        if i > 1 and (commanded[i] - commanded[i - 1]) * (commanded[i - 1] - commanded[i - 2]) < 0:
            start = commanded[i - 1]
        travel[i] = abs(commanded[i] - start)
    # before the first reversal the state of the backlash is unknown
    reversals = [
        i
        for i in range(2, len(commanded))
        if (commanded[i] - commanded[i - 1]) * (commanded[i - 1] - commanded[i - 2]) < 0
    ]
    travel[: reversals[0] if reversals else len(commanded)] = 0.0
    return travel
