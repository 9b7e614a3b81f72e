"""Disparity by the power cepstrum of the two windows side by side, over the whole range by itself.

The right window beside the left one is an echo of it; the logarithm of the power spectrum turns the echo into a ripple,
whose period, read off the spectrum's spectrum, is their distance (Yeshurun and Schwartz, 1989; Olson and Coombs, 1991).
One cepstrum shows echoes up to half a window's width: the range is covered by windows of the right image half a width
apart. The highest peak over all of them is the disparity, if it stands out: of the noise, and of every other peak. It
is whole pixels sharp, so the right window is moved by it and looked at again until what is left is zero.
"""

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_metric.disparity.correlation import parabola
from vergence_metric.disparity.parameters import DisparityParameters
from vergence_metric.disparity.protocol import (
    Candidate,
    Disparity,
    DisparityEstimator,
    DisparityStatus,
    Image,
    Point,
)
from vergence_metric.disparity.windows import tapered

Grey = NDArray[np.floating]

_SIDES_PX = (64, 96)  # of the windows; a match has to show in one of them
_SIGMA_SHARE = 0.25  # of a window's side: standard deviation of its Gaussian taper
_SMALLEST_POWER = 1e-3  # of the mean: the logarithm of what is weaker than noise is no echo

_LEAST_HEIGHT = 10.0  # of a peak, in standard deviations of the cepstrum
_LEAST_LEAD = 1.6  # over every other peak, as a ratio of heights
_APART_PX = 4  # peaks closer than this are one
_ROUNDS = 4
_FINE_REACH_PX = 3
_STEADY_PX = 0.02
_SIGMA_PX = 0.15


@dataclass(frozen=True)
class CepstralPeak:
    """An echo: disparities [px] and its height in standard deviations of the cepstrum about it."""

    horizontal_px: float
    vertical_px: float
    height: float


class CepstralEstimator(DisparityEstimator):
    """The highest peak of the cepstra over the whole range; it fails where no peak, or more than one, stands out."""

    name = "cepstral"

    def __init__(self, parameters: DisparityParameters) -> None:
        self._parameters = parameters

    def estimate_at(self, left: Image, right: Image, point_px: Point, expected_px: float | None) -> Disparity:
        """Return the disparity at a point; `expected_px` makes no difference. See DisparityEstimator."""
        p, answers = self._parameters, []
        greys = left.astype(np.float32), right.astype(np.float32)
        for side in _SIDES_PX:
            window = EchoWindow(greys, point_px, side)
            if window.deviation < p.min_texture:
                continue
            peaks = _highest(window.heights(p.max_px, p.max_vertical_px))
            if not peaks:
                continue
            lead = peaks[0].height / max(peaks[1].height, 1e-6) if len(peaks) > 1 else math.inf
            answers.append((lead, window, peaks))
            if peaks[0].height >= _LEAST_HEIGHT and lead >= _LEAST_LEAD:
                break
        if not answers:
            return Disparity.none(DisparityStatus.NO_TEXTURE, "no texture in the windows", self.name, point_px)
        lead, window, peaks = max(answers, key=lambda one: (one[2][0].height >= _LEAST_HEIGHT, one[0]))
        best = peaks[0]
        total = sum(peak.height for peak in peaks)
        candidates = tuple(
            Candidate(peak.horizontal_px, peak.height / total, f"cepstrum of {window.side} px") for peak in peaks
        )
        refined = window.refined(best)
        across, down = (best.horizontal_px, best.vertical_px) if refined is None else refined
        status, reason = DisparityStatus.OK, ""
        if best.height < _LEAST_HEIGHT:
            status, reason = DisparityStatus.NO_MATCH, f"the highest peak has {best.height:.1f} standard deviations"
        elif lead < _LEAST_LEAD:
            other = peaks[1].horizontal_px
            status, reason = DisparityStatus.AMBIGUOUS, f"a peak at {other:+.0f} px is {1 / lead:.0%} as high"
        elif refined is None:
            status, reason = DisparityStatus.NO_MATCH, "the echo does not settle where its peak is"
        elif abs(across) > p.max_px + 0.5 or abs(down) > p.max_vertical_px + 0.5:
            status, reason = DisparityStatus.OUT_OF_RANGE, f"the peak lies at {across:+.1f}, {down:+.1f} px"
        # Half at the least lead that counts, and the surer the farther the second peak is below.
        confidence = max(1.0 - 0.5 * (_LEAST_LEAD / lead) ** 2, 0.0)
        if status is not DisparityStatus.OK:
            confidence = min(confidence, 0.5)
        return Disparity(across, down, _SIGMA_PX, confidence, status, reason, self.name, point_px, candidates)


class EchoWindow:
    """The tapered window of the left image about a point, and its echoes in windows of the right one.

    `deviation` is the standard deviation of what it holds [grey levels].
    """

    def __init__(self, greys: tuple[Grey, Grey], point_px: Point, side: int) -> None:
        """Cut the window, `side` px wide and high, of grey images (h, w) float32, left and right."""
        self._right, self._point_px, self.side = greys[1], point_px, side
        self._first = _tapered_at(greys[0], point_px, side)
        weights = _taper(side)
        self.deviation = float(np.sqrt((self._first**2).sum() / (weights**2).sum()))

    def heights(self, reach_px: int, vertical_px: int) -> NDArray[np.float64]:
        """Return the heights of the cepstra (2 vertical_px + 3, 2 reach_px + 1) over both disparities.

        Rows are vertical disparities from `vertical_px` + 1 down to -`vertical_px` - 1, columns horizontal ones from
        -`reach_px` up. Unknown ones, outside the right image, are -inf.
        """
        step = self.side // 2
        count = max(math.ceil(reach_px / step), 1)
        shifts = np.arange(-count, count + 1) * step
        heights = np.full((2 * vertical_px + 3, 2 * (count + 1) * step + 1), -np.inf)
        middle = heights.shape[1] // 2
        rows = np.arange(-vertical_px - 1, vertical_px + 2)
        columns = np.arange(-step // 2 - 2, step // 2 + 3)
        for shift in shifts:
            center = (self._point_px[0] - shift, self._point_px[1])
            if not -step < center[0] < self._right.shape[1] + step:
                continue
            cepstrum = _cepstrum(self._first, _tapered_at(self._right, center, self.side))
            part = cepstrum[np.ix_(rows % cepstrum.shape[0], self.side + columns)]
            # Content right of the window's middle by c is at the disparity shift - c.
            at = middle + shift - columns
            heights[:, at] = np.maximum(heights[:, at], part)
        return heights[:, middle - reach_px : middle + reach_px + 1]

    def refined(self, peak: CepstralPeak) -> tuple[float, float] | None:
        """Return the disparities of a peak to a fraction of a pixel; None where it does not settle."""
        across, down = peak.horizontal_px, peak.vertical_px
        x, y = self._point_px
        near = np.arange(-_FINE_REACH_PX, _FINE_REACH_PX + 1)
        for _ in range(_ROUNDS):
            cepstrum = _cepstrum(self._first, _tapered_at(self._right, (x - across, y - down), self.side))
            part = cepstrum[np.ix_(near % cepstrum.shape[0], self.side + near)]
            j, i = divmod(int(part.argmax()), len(near))
            if not (0 < i < len(near) - 1 and 0 < j < len(near) - 1):
                return None
            step = (
                near[i] + parabola(part[j, i - 1], part[j, i], part[j, i + 1]),
                near[j] + parabola(part[j - 1, i], part[j, i], part[j + 1, i]),
            )
            across, down = across - float(step[0]), down - float(step[1])
            if math.hypot(*step) < _STEADY_PX:
                break
        return across, down


def _taper(side: int) -> NDArray[np.float32]:
    line = np.exp(-0.5 * ((np.arange(side) - (side - 1) / 2) / (_SIGMA_SHARE * side)) ** 2)
    return np.outer(line, line).astype(np.float32)


def _tapered_at(grey: Grey, center: Point, side: int) -> Grey:
    window = cv2.getRectSubPix(grey, (side, side), center, patchType=cv2.CV_32F)
    return tapered(np.asarray(window, np.float32), _SIGMA_SHARE * side)


def _cepstrum(first: Grey, second: Grey) -> NDArray[np.float64]:
    """Return the power cepstrum (2 side, 4 side) of two windows side by side, in its own standard deviations.

    The echo of the second one is at column `side` plus what its content lies right of the first's, and at the row
    below. Both windows get the same power: the echo is as strong as their least one.
    """
    side = first.shape[0]
    # Empty room around keeps the echo's multiples away from the echo.
    canvas = np.zeros((2 * side, 4 * side), np.float32)
    power = [max(float(np.sqrt((one**2).sum())), 1e-6) for one in (first, second)]
    canvas[:side, :side], canvas[:side, side : 2 * side] = first / power[0], second / power[1]
    spectrum = np.abs(np.fft.rfft2(canvas)) ** 2
    cepstrum = np.fft.irfft2(np.log(spectrum + _SMALLEST_POWER * spectrum.mean()), s=canvas.shape)
    about = cepstrum[:, side // 2 : side + side // 2]
    return np.asarray(cepstrum / max(float(about.std()), 1e-12))


def _highest(heights: NDArray[np.float64]) -> list[CepstralPeak]:
    """Return up to four peaks of heights as `EchoWindow.heights` gives them, the highest first."""
    left, peaks = heights.copy(), []
    middle_row, middle_column = (size // 2 for size in heights.shape)
    for _ in range(4):
        j, i = divmod(int(left.argmax()), left.shape[1])
        if not np.isfinite(left[j, i]):
            break
        peaks.append(CepstralPeak(float(i - middle_column), float(middle_row - j), float(left[j, i])))
        left[:, max(i - _APART_PX, 0) : i + _APART_PX + 1] = -np.inf
    return peaks
