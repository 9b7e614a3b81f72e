"""Pictures that cannot be measured though they arrive: frozen, the same in both eyes, black or white."""

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from vergence_metric.pairs.lasting_condition import LastingCondition

Thumbnail = npt.NDArray[np.int16]

_SIDE = 64  # samples along each side of the picture
_BLACK, _WHITE = 12.0, 250.0
_LEAST_TEXTURE = 2.0
_NOISE_PAIRS = 5
_NOISE_CORRELATION = (-0.75, -0.25)


@dataclass(frozen=True)
class PictureFault:
    """What is wrong, in words, and whether nothing measured in the pair may be used."""

    reason: str
    unusable: bool


@dataclass(slots=True)
class _Eye:
    """One eye's last picture, and whether its camera has noise: only then are equal pictures a frozen camera's."""

    name: str
    last: Thumbnail | None = None
    change: Thumbnail | None = None
    noisy_pairs: int = 0
    frozen: LastingCondition = field(default_factory=LastingCondition)
    black: LastingCondition = field(default_factory=LastingCondition)
    white: LastingCondition = field(default_factory=LastingCondition)

    def update(self, picture: Thumbnail, stamp_s: float) -> tuple[str, bool]:
        """Return what is wrong with the picture, "" if nothing is, and whether it is dark or saturated."""
        same = self.last is not None and np.array_equal(self.last, picture)
        if self.last is not None and not same:
            self._watch_noise(picture - self.last)
        self.last = picture
        frozen = self.frozen.update(same, stamp_s) and self.noisy_pairs >= _NOISE_PAIRS
        mean = float(picture.mean())
        # The percentiles are slow, and the mean excludes most pictures.
        if self.black.update(mean < 2.0 * _BLACK and float(np.percentile(picture, 99)) <= _BLACK, stamp_s):
            return "is black", True
        if self.white.update(mean > _WHITE - 5.0 and float(np.percentile(picture, 1)) >= _WHITE, stamp_s):
            return "is white (saturated)", True
        return ("is frozen: the same picture with new stamps", False) if frozen else ("", False)

    def _watch_noise(self, change: Thumbnail) -> None:
        """Noise and motion differ in sign: successive changes by noise correlate by -0.5, those by motion do not.

        A simulator without noise shows the same picture while nothing moves.
        """
        before, self.change = self.change, change
        if before is None or self.noisy_pairs >= _NOISE_PAIRS:
            return
        a, b = before.astype(np.float64), change.astype(np.float64)
        power = math.sqrt(float((a * a).sum() * (b * b).sum()))
        correlation = float((a * b).sum()) / power if power else 0.0
        lowest, highest = _NOISE_CORRELATION
        self.noisy_pairs = self.noisy_pairs + 1 if lowest < correlation < highest else 0


class PictureMonitor:
    """Watches successive pairs, on some 4,000 samples of each picture."""

    def __init__(self) -> None:
        self.fault: PictureFault | None = None
        """Of the newest pair; None if nothing is wrong."""
        self._shapes: tuple[Any, ...] = ()
        self._stamp_s = -math.inf
        self._eyes, self._same = (_Eye("left"), _Eye("right")), LastingCondition()

    def update(self, stamp_s: float, left: npt.NDArray[Any], right: npt.NDArray[Any]) -> PictureFault | None:
        """Return what is wrong with a pair, (h, w, 3) BGR or (h, w) grey uint8; None if nothing is."""
        if (left.shape, right.shape) != self._shapes or not stamp_s > self._stamp_s:
            self._shapes = left.shape, right.shape
            self._eyes, self._same = (_Eye("left"), _Eye("right")), LastingCondition()
        self._stamp_s = stamp_s
        pictures = _thumbnail(left), _thumbnail(right)
        same = self._same.update(self._in_both(*pictures), stamp_s)
        faults = [eye.update(picture, stamp_s) for eye, picture in zip(self._eyes, pictures, strict=True)]
        self.fault = self._judged(faults, same)
        return self.fault

    def _judged(self, faults: list[tuple[str, bool]], same: bool) -> PictureFault | None:
        texts = [f"the {eye.name} image {text}" for eye, (text, _) in zip(self._eyes, faults, strict=True) if text]
        unlit = [dark for _, dark in faults]
        frozen = any(text and not dark for text, dark in faults)
        if same and not any(unlit):
            texts.append("both eyes show the same picture: one camera feeds both")
        if not texts:
            return None
        # With one eye covered the other still sees a target's direction.
        return PictureFault("; ".join(texts), frozen or same or all(unlit))

    def _in_both(self, left: Thumbnail, right: Thumbnail) -> bool:
        """Return whether one camera's pictures come from both eyes, at once or one picture apart."""
        before = self._eyes[0].last, self._eyes[1].last
        pairs = ((left, right), (left, before[1]), (before[0], right))
        same = any(a is not None and b is not None and np.array_equal(a, b) for a, b in pairs)
        return same and float(left.std()) > _LEAST_TEXTURE


def _thumbnail(pixels: npt.NDArray[Any]) -> Thumbnail:
    """Return samples of the picture, of its green channel if it has colours."""
    rows, columns = (max(size // _SIDE, 1) for size in pixels.shape[:2])
    samples = pixels[::rows, ::columns]
    return np.asarray(samples if samples.ndim == 2 else samples[:, :, 1], np.int16)
