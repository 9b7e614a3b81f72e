"""Search for the point of the left image in the right one: the smallest window with an unambiguous match decides.

A small window holds only the surface at the point, but correlates at many places; a large one is unambiguous, but
matches whatever surface fills it. So the small window proposes the candidates that correlate about as well as its best,
and each larger window chooses among those. Where only a large window is unambiguous, the small ones search again near
its match: a small object before a background is found beside the background. Every match is checked from right to left.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vergence_metric.disparity.candidates import COLUMN_PX
from vergence_metric.disparity.correlation import Surface, correlate, radius_of, texture_about
from vergence_metric.disparity.evidence import Evidence
from vergence_metric.disparity.fovea_pair import FoveaPair, Strip
from vergence_metric.disparity.parameters import DisparityParameters
from vergence_metric.disparity.protocol import DisparityStatus, Image

_VICINITY_PX = 24
_HALVED_FROM_PX = 8.0  # windows of this deviation or more are searched wide at half resolution
_REVERSE_PX = 24
_SAME_PX = 4.0  # candidates of different windows this close are one


@dataclass(frozen=True)
class Match:
    """Where the point was found: disparities in full-resolution pixels, the window that decided, and its evidence.

    `status` is OK, or why there is no match; the disparity is then the best guess, NaN if there is none.
    """

    horizontal_px: float
    vertical_px: float
    sigma_px: float
    window_px: float
    evidence: Evidence
    status: DisparityStatus
    reason: str

    @property
    def confident(self) -> bool:
        """True if the match is OK and more likely right than not."""
        return self.status is DisparityStatus.OK and self.evidence.confidence > 0.5


def pair_about(left: Image, right: Image, point_px: tuple[float, float], parameters: DisparityParameters) -> FoveaPair:
    """Return the crops that a search about this point needs."""
    margin = radius_of(max(*parameters.windows_px, COLUMN_PX[1])) + 4
    reach = parameters.max_px + max(_VICINITY_PX, parameters.track_px)
    return FoveaPair(left, right, point_px, reach, parameters.max_vertical_px + 4, margin)


def find(pair: FoveaPair, parameters: DisparityParameters, expected_px: float | None = None) -> Match:
    """Find the point: near the expected disparity if that match is confident, else in the whole range.

    A match near the expected disparity is AMBIGUOUS, and keeps its values, where one far from it fits as well; a caller
    with reason to trust the expectation may use it.
    """
    search = _Search(pair, parameters)
    if expected_px is not None and abs(expected_px) <= parameters.max_px:
        near = search.near(expected_px, parameters.track_px)
        if near.confident:
            return search.against_far(near)
    return search.wide()


@dataclass(frozen=True)
class _Layer:
    """A surface with the full-resolution disparity of each column; `scale` is full-resolution pixels per pixel."""

    surface: Surface
    window_px: float
    scale: int
    profile: NDArray[np.float32]
    visible: NDArray[np.bool_]

    def disparity(self, column: int) -> int:
        return (self.surface.first_d + column) * self.scale

    def column(self, disparity: float) -> int:
        return round(disparity / self.scale) - self.surface.first_d


class _Search:
    def __init__(self, pair: FoveaPair, parameters: DisparityParameters) -> None:
        self._pair, self._parameters = pair, parameters

    def _at(self, scale: int) -> tuple[Strip, Strip, tuple[int, int]]:
        """Return both strips at a scale and where the point is there."""
        left, right = self._pair.full if scale == 1 else self._pair.half
        return left, right, (round(self._pair.point_px[0] / scale), round(self._pair.point_px[1] / scale))

    def _layer(self, window_px: float, middle_px: float, half_px: int, scale: int) -> _Layer:
        left, right, at = self._at(scale)
        middle, half = round(middle_px / scale), half_px // scale
        vertical = -(-self._parameters.max_vertical_px // scale)
        surface = correlate(left, right, at, window_px / scale, (middle - half, middle + half), (-vertical, vertical))
        disparities = (surface.first_d + np.arange(surface.zncc.shape[1])) * scale
        x = self._pair.point_px[0] - disparities
        visible = (x >= 0) & (x <= self._pair.left.shape[1] - 1)
        return _Layer(surface, window_px, scale, np.where(visible, surface.profile, -1.0), visible)

    def _wide_layer(self, window_px: float) -> _Layer:
        reach = self._parameters.max_px
        return self._layer(window_px, 0, reach, _wide_scale(window_px))

    def near(self, middle_px: float, half_px: int) -> Match:
        """Search about a disparity at full resolution."""
        # Beyond the range the crops end; a fit at the end of the range is said to be OUT_OF_RANGE.
        return self._decide(lambda window_px: self._layer(window_px, middle_px, half_px, 1), lambda _: 1)

    def wide(self) -> Match:
        """Search the whole range, then the vicinity of what a large window found."""
        match = self._decide(self._wide_layer, _wide_scale)
        if not match.confident or match.window_px <= self._parameters.windows_px[0]:
            return match
        vicinity = self.near(match.horizontal_px, _VICINITY_PX)
        if not vicinity.confident or vicinity.window_px >= match.window_px:
            return match
        # Its confidence is at most that of the coarser match.
        return replace(vicinity, evidence=vicinity.evidence.at_most(match.evidence.confidence))

    def against_far(self, near: Match) -> Match:
        """Return the match, AMBIGUOUS where its window and all larger ones also fit elsewhere in the whole range."""
        others: list[int] | None = None
        second = 0.0
        for window_px in self._parameters.windows_px:
            if window_px < near.window_px:
                continue
            layer = self._wide_layer(window_px)
            own = layer.surface.peak_near(near.horizontal_px / layer.scale, 2 // layer.scale)[2]
            floor = 1.0 - _unexplained(own, self._parameters.uniqueness)
            peaks = [
                p
                for p in _peaks(layer.profile)
                if layer.profile[p] ** 2 >= floor
                and abs(layer.disparity(p) - near.horizontal_px) > self._parameters.track_px
                and (others is None or any(abs(layer.disparity(p) - r) <= _SAME_PX for r in others))
            ]
            if not peaks:
                return near
            others = [layer.disparity(p) for p in peaks]
            second = max(float(layer.profile[p]) for p in peaks) / max(own, 1e-3)
        evidence = replace(near.evidence, second=min(second, 1.0) * near.evidence.correlation)
        return replace(
            near, evidence=evidence, status=DisparityStatus.AMBIGUOUS, reason="another disparity fits as well"
        )

    def _decide(self, layer_of: Callable[[float], _Layer], scale_of: Callable[[float], int]) -> Match:
        """Let each window choose among the candidates of the smaller ones, until one match is confident."""
        texture, windows = self._parameters.min_texture, self._parameters.windows_px
        scale = scale_of(windows[-1])
        left, _, at = self._at(scale)
        if texture_about(left, at, windows[-1] / scale).signal < texture:
            return _nothing(DisparityStatus.NO_TEXTURE, "too little structure at the point", windows[-1])
        candidates: list[int] | None = None
        best: Match | None = None
        for window_px in windows:
            layer = layer_of(window_px)
            if window_px == windows[0] and not layer.visible.any():
                reason = "every match would lie outside the right image"
                return _nothing(DisparityStatus.OUT_OF_RANGE, reason, window_px)
            if layer.surface.texture.signal < texture:
                continue
            columns = self._candidates(layer, candidates)
            candidates = [layer.disparity(c) for c in columns]
            match = self._judge(layer, columns)
            if match.confident:
                return match
            if best is None or match.evidence.confidence >= best.evidence.confidence:
                best = match
        assert best is not None
        return best

    def _candidates(self, layer: _Layer, before: list[int] | None) -> list[int]:
        """Return the columns of the peaks that fit about as well as the best, best first."""
        peaks = _peaks(layer.profile)
        if before is not None:
            near = [p for p in peaks if any(abs(layer.disparity(int(p)) - b) <= _SAME_PX for b in before)]
            peaks = np.array(near, int)
        if len(peaks) == 0:
            return []
        top = float(layer.profile[peaks].max())
        floor = 1.0 - _unexplained(top, self._parameters.uniqueness)
        kept = peaks[layer.profile[peaks] ** 2 >= floor]
        return [int(p) for p in kept[np.argsort(-layer.profile[kept])]]

    def _judge(self, layer: _Layer, columns: list[int]) -> Match:
        """Judge the best candidate of one window."""
        if not columns:
            return _nothing(DisparityStatus.NO_MATCH, "nothing in the right image fits", layer.window_px)
        surface, scale = layer.surface, layer.scale
        i, j, value = surface.peak_near(surface.first_d + columns[0], 0)
        horizontal, vertical = surface.subpixel(i, j)
        second = max((float(layer.profile[c]) for c in columns[1:] if abs(c - i) * scale > 3), default=0.0)
        evidence = Evidence(
            correlation=value,
            independent=surface.texture.independent,
            places=float(surface.zncc.size),
            second=second,
            left_right_px=self._left_right_error(layer, i, j),
        )
        sigma_px = scale * deviation_px(surface, value)
        guess = (horizontal * scale, vertical * scale, sigma_px, layer.window_px, evidence)
        rows, width = surface.zncc.shape
        if not evidence.beyond_chance:
            return Match(*guess, DisparityStatus.NO_MATCH, f"the best correlation, {value:.2f}, may be chance")
        if second > 0.0:
            return Match(*guess, DisparityStatus.AMBIGUOUS, f"{len(columns)} disparities fit about as well")
        if i in (0, width - 1) or (rows > 1 and j in (0, rows - 1)):
            return Match(*guess, DisparityStatus.OUT_OF_RANGE, "the best fit lies at the edge of the searched range")
        if evidence.left_right_px > self._parameters.left_right_px:
            reason = f"matching back from the right image misses by {evidence.left_right_px:.1f} px"
            return Match(*guess, DisparityStatus.NO_MATCH, reason)
        return Match(*guess, DisparityStatus.OK, "")

    def _left_right_error(self, layer: _Layer, i: int, j: int) -> float:
        """Match back from the right image; return how far from the point it ends, in full-resolution pixels."""
        scale, surface, sigma = layer.scale, layer.surface, layer.window_px / layer.scale
        left, right, point = self._at(scale)
        d, v = surface.first_d + i, surface.first_v + j
        at = (point[0] - d, point[1] - v)
        back = _reverse_range(at, d, left, right, sigma, _REVERSE_PX // scale)
        if back is None:
            return math.inf
        reverse = correlate(right, left, at, sigma, back, (v - 1, v + 1), sign=1)
        k = int(reverse.profile.argmax())
        there, again = surface.subpixel(i, j), reverse.subpixel(k, int(reverse.zncc[:, k].argmax()))
        # Between the peaks proper: at half resolution an odd disparity lies half way between two columns.
        return abs(again[0] - there[0]) * float(scale)


def _wide_scale(window_px: float) -> int:
    return 1 if window_px < _HALVED_FROM_PX else 2


def _peaks(profile: NDArray[np.float32]) -> NDArray[np.intp]:
    """Return the columns of the positive local maxima."""
    padded = np.pad(profile, 1, constant_values=-2.0)
    return np.flatnonzero((profile >= padded[:-2]) & (profile >= padded[2:]) & (profile > 0.0))


def _unexplained(correlation: float, uniqueness: float) -> float:
    """Return the share of grey-level variance that a second may leave unexplained and still count as fitting as well.

    30 % more than the best leaves, for noise, and what sampling and perspective leave unexplained of a true match.
    """
    return (1.0 - correlation**2) * 1.3 + (1.0 - uniqueness**2)


def deviation_px(surface: Surface, correlation: float) -> float:
    """Return the standard deviation of a correlation peak's place, in pixels of the surface's resolution.

    What the match leaves unexplained is taken as white noise in the window's independent samples, over the texture's
    correlation length (Cramer-Rao bound of a shift).
    """
    independent = max(surface.texture.independent, 1e-3)
    unexplained = math.sqrt(max(1.0 - correlation**2, 1e-4)) / max(correlation, 0.1)
    length = surface.texture.length
    return float(unexplained * length / math.sqrt(max(independent, 1.0)))


def _reverse_range(
    at: tuple[int, int], d: int, left: Strip, right: Strip, sigma: float, half: int
) -> tuple[int, int] | None:
    """Return the range of disparities about d whose left windows lie inside the crop; None if d's own does not."""
    radius = radius_of(sigma)
    if at[0] - right.x0 < radius or at[0] - right.x0 + radius >= right.grey.shape[1]:
        return None
    low = max(d - half, int(left.x0) + radius - at[0])
    high = min(d + half, int(left.x0) + left.grey.shape[1] - 1 - radius - at[0])
    return (low, high) if low <= d <= high else None


def _nothing(status: DisparityStatus, reason: str, window_px: float) -> Match:
    return Match(math.nan, math.nan, math.nan, window_px, Evidence.nothing(), status, reason)
