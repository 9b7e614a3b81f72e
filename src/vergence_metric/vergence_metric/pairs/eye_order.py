"""Eyes that are wired or mounted wrongly: exchanged, one mirrored, upside down, or one that shows noise.

A region of the left image is looked for in the right one as it is and in its mirror images. What both eyes see lies in
front of them, and stays where it is while they converge: with exchanged images it seems to lie behind, or moves by
twice their turn.
"""

import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from vergence_metric.pairs.lasting_condition import LastingCondition

Pixels = npt.NDArray[np.uint8]

_WIDTH_PX = 160  # of the pictures that are compared
_REGION = 0.45  # of their sides
_BLUR_PX = 8.0
_PERIOD_S = 0.2
_SURE, _UNLIKE = 0.7, 0.45  # correlation of pictures that match, and that do not
_BEHIND_RAD = math.radians(0.8)  # more than mounts and calibrated joints are off
_SWAPPED = "left and right image seem to be swapped"
_RESTING_RAD = math.radians(0.15)
_LEAST_TURN_RAD = math.radians(1.0)
_ENOUGH_TURN_RAD = math.radians(2.5)
_NOISE_SIDE_PX = 128
_NOISE_CORRELATION = 0.3  # of neighbouring pixels; 0.8 and more in pictures of anything
_LEAST_NOISE = 12.0

_MIRRORED = {
    "mirrored (left and right exchanged)": 1,
    "upside down (mirrored top to bottom)": 0,
    "upside down (turned by half a turn)": -1,
}
"""Codes of cv2.flip by what they show."""


class EyeOrderMonitor:
    """Watches successive pairs, some five times a second of their stamps."""

    def __init__(self) -> None:
        self.fault = ""
        """What is wrong with the newest pair; "" if nothing is."""
        self._restart()

    def _restart(self) -> None:
        self._stamp_s = -math.inf
        self._noise = {eye: LastingCondition() for eye in ("left", "right")}
        self._mirrored = {what: LastingCondition() for what in _MIRRORED}
        self._behind, self._turns = LastingCondition(), _Turns()

    def update(
        self, stamp_s: float, left: Pixels, right: Pixels, vergence_rad: float = math.nan, focal_px: float = math.nan
    ) -> str:
        """Return what is wrong with a pair.

        Args:
            stamp_s: of the pair.
            left: image (h, w, 3) BGR or (h, w) grey.
            right: image of the same size.
            vergence_rad: of the eyes then, NaN if unknown.
            focal_px: focal length [px], NaN if unknown.
        """
        if stamp_s < self._stamp_s:
            self._restart()
        if stamp_s - self._stamp_s < _PERIOD_S:
            return self.fault
        self._stamp_s = stamp_s
        noisy = {
            eye: condition.update(_is_noise(image), stamp_s)
            for (eye, condition), image in zip(self._noise.items(), (left, right), strict=True)
        }
        faults = [f"the {eye} image shows nothing but noise" for eye, holds in noisy.items() if holds]
        faults += self._compared(stamp_s, left, right, vergence_rad, focal_px)
        self.fault = "; ".join(faults)
        return self.fault

    def _compared(self, stamp_s: float, left: Pixels, right: Pixels, vergence_rad: float, focal_px: float) -> list[str]:
        ours, theirs = _small(left), _small(right)
        straight, shift_px = _match(ours, theirs)
        scores = {what: _match(ours, cv2.flip(theirs, code))[0] for what, code in _MIRRORED.items()}
        best = max(scores, key=lambda what: scores[what])
        found = ""
        for what, condition in self._mirrored.items():
            holds = what == best and scores[what] > _SURE and straight < _UNLIKE
            if condition.update(holds, stamp_s):
                found = f"one eye's image is {what} against the other's"
        shift_rad = math.atan(shift_px * left.shape[1] / ours.shape[1] / focal_px) if focal_px > 0 else math.nan
        seen_rad = vergence_rad - shift_rad if straight > _SURE else math.nan
        self._turns.update(vergence_rad, seen_rad)
        if self._behind.update(seen_rad < -_BEHIND_RAD, stamp_s):
            where = f"what both show would lie behind the head (vergence {math.degrees(seen_rad):.1f} deg)"
            return [f"{_SWAPPED}, or the zeros of the pan joints are off: {where}"]
        if self._turns.exchanged:
            return [f"{_SWAPPED}: what both show moves by twice the angle by which the eyes converge"]
        return [found] if found else []


@dataclass(slots=True)
class _Turns:
    """How the vergence that what is seen needs changes with that of the eyes, from rest to rest."""

    last_rad: float = math.nan
    rest: tuple[float, float] | None = None
    evidence: float = 0.0

    @property
    def exchanged(self) -> bool:
        """Whether it changes by twice as much: it should not change at all."""
        return self.evidence >= _ENOUGH_TURN_RAD

    def update(self, vergence_rad: float, seen_rad: float) -> None:
        """Add a picture; NaN for what is unknown."""
        resting = abs(vergence_rad - self.last_rad) < _RESTING_RAD
        self.last_rad = vergence_rad
        if not resting or not math.isfinite(seen_rad):
            return
        if self.rest is None:
            self.rest = (vergence_rad, seen_rad)
            return
        turned_rad = vergence_rad - self.rest[0]
        if abs(turned_rad) < _LEAST_TURN_RAD:
            return
        ratio = (seen_rad - self.rest[1]) / turned_rad
        if 1.5 < ratio < 2.5:
            self.evidence += abs(turned_rad)
        elif ratio < 1.2:  # eyes that follow what they see have at most 1
            self.evidence = 0.0
        self.rest = (vergence_rad, seen_rad)


def _small(image: Pixels) -> npt.NDArray[np.float32]:
    """Return the picture in grey, of _WIDTH_PX, without its slow changes of brightness."""
    grey = image if image.ndim == 2 else image[:, :, 1]
    height_px = max(round(_WIDTH_PX * image.shape[0] / image.shape[1]), 8)
    small = cv2.resize(grey, (_WIDTH_PX, height_px), interpolation=cv2.INTER_AREA).astype(np.float32)
    return np.asarray(small - cv2.GaussianBlur(small, (0, 0), _BLUR_PX), np.float32)


def _match(left: npt.NDArray[Any], right: npt.NDArray[Any]) -> tuple[float, float]:
    """Return the correlation of the left middle's best place in the right picture, and its shift, right less left [px].

    The correlation is 0 where the middle has no structure.
    """
    height, width = (round(_REGION * side) for side in left.shape)
    top, begin = (left.shape[0] - height) // 2, (left.shape[1] - width) // 2
    region = np.ascontiguousarray(left[top : top + height, begin : begin + width])
    if float(region.std()) < 1.0 or float(right.std()) < 1.0:
        return 0.0, math.nan
    scores = cv2.matchTemplate(np.ascontiguousarray(right), region, cv2.TM_CCOEFF_NORMED)
    _, score, _, (column, row) = cv2.minMaxLoc(scores)
    return float(score), column - begin + _peak(scores[row, max(column - 1, 0) : column + 2])


def _peak(around: npt.NDArray[Any]) -> float:
    """Return the place of the vertex of a parabola through three values, from the middle one; 0 at a border."""
    if len(around) != 3 or 2 * around[1] <= around[0] + around[2]:
        return 0.0
    return float(0.5 * (around[2] - around[0]) / (2 * around[1] - around[0] - around[2]))


def _is_noise(image: Pixels) -> bool:
    """Return whether neighbouring pixels of the middle have nothing to do with each other."""
    rows, columns = (max((side - _NOISE_SIDE_PX) // 2, 0) for side in image.shape[:2])
    middle = image[rows : rows + _NOISE_SIDE_PX, columns : columns + _NOISE_SIDE_PX]
    grey = (middle if middle.ndim == 2 else middle[:, :, 1]).astype(np.float32)
    if min(grey.shape) < 8 or float(grey.std()) < _LEAST_NOISE:
        return False
    one, other = grey[:, :-1] - grey.mean(), grey[:, 1:] - grey.mean()
    power = math.sqrt(float((one * one).sum() * (other * other).sum()))
    return power > 0 and float((one * other).sum()) / power < _NOISE_CORRELATION
