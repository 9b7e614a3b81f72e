"""Find where the point of the left image lies in the right one: the smallest window that is sure decides.

Small windows see the surface at the point itself and no other, but many places look alike to them; large windows are
sure, but of whatever fills them. So the small window names the candidates that it cannot tell from its best, and each
larger window may only choose among those. Then the answer is checked the other way, from right to left.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vergence_metric.disparity.correlation import REACH_IN_SIGMAS, Surface, correlate, radius_of
from vergence_metric.disparity.evidence import Evidence
from vergence_metric.disparity.fovea_pair import FoveaPair, Strip
from vergence_metric.disparity.protocol import DisparityStatus, Image
from vergence_metric.fovea_parameters import DisparityParameters


@dataclass(frozen=True)
class Match:
    """Where the point was found: disparities in full-resolution pixels, the window that decided, and how sure it is.

    `status` is OK, or says why there is no answer; the disparity is then the best guess, NaN if there is none.
    """

    horizontal_px: float
    vertical_px: float
    sigma_px: float
    window_px: float
    evidence: Evidence
    status: DisparityStatus
    reason: str

    @property
    def sure(self) -> bool:
        """True if the answer is more likely right than not."""
        return self.status is DisparityStatus.OK and self.evidence.confidence > 0.5


def pair_about(left: Image, right: Image, point_px: tuple[float, float], parameters: DisparityParameters) -> FoveaPair:
    """Return the crops that a search about this point needs."""
    margin = radius_of(max(parameters.disparity_windows_px)) + 4
    reach = parameters.disparity_max_px + parameters.disparity_track_px
    return FoveaPair(left, right, point_px, reach, parameters.disparity_max_vertical_px + 4, margin)


def find(pair: FoveaPair, parameters: DisparityParameters, expected_px: float | None = None) -> Match:
    """Find the point: about the expected disparity if that is sure, else over the whole range.

    An answer about the expected disparity is AMBIGUOUS, and keeps its figures, where another one far from it fits as
    well: who has reason to trust the expectation may use it.
    """
    if expected_px is not None and abs(expected_px) <= parameters.disparity_max_px:
        near = _find_near(pair, parameters, expected_px)
        if near.sure:
            return _against_far(pair, parameters, near)
    return _find_wide(pair, parameters)


def _against_far(pair: FoveaPair, parameters: DisparityParameters, near: Match) -> Match:
    """Look whether the window that decided would have fitted elsewhere in the whole range."""
    surface = _wide_surface(pair, parameters, near.window_px)
    profile = np.where(_visible(pair, surface, 2), surface.profile, -1.0)
    own = surface.peak_near(near.horizontal_px / 2, 1)
    away = np.abs((surface.first_d + np.arange(len(profile))) * 2 - near.horizontal_px) > parameters.disparity_track_px
    rival = float(profile[away].max(initial=0.0))
    if rival**2 < 1.0 - _unexplained(own[2], parameters.disparity_uniqueness):
        return near
    evidence = replace(near.evidence, rival=min(rival, near.evidence.correlation))
    return replace(near, evidence=evidence, status=DisparityStatus.AMBIGUOUS, reason="another disparity fits as well")


def _find_near(pair: FoveaPair, parameters: DisparityParameters, expected_px: float) -> Match:
    left, right = pair.full
    at = (round(pair.point_px[0]), round(pair.point_px[1]))
    middle, half = round(expected_px), parameters.disparity_track_px
    vertical = parameters.disparity_max_vertical_px
    surfaces = [
        correlate(left, right, at, sigma, (middle - half, middle + half), (-vertical, vertical))
        for sigma in parameters.disparity_windows_px
    ]
    return _decide(pair, parameters, surfaces, parameters.disparity_windows_px, 1)


def _find_wide(pair: FoveaPair, parameters: DisparityParameters) -> Match:
    surfaces = [_wide_surface(pair, parameters, window_px) for window_px in parameters.disparity_windows_px]
    return _decide(pair, parameters, surfaces, parameters.disparity_windows_px, 2)


def _wide_surface(pair: FoveaPair, parameters: DisparityParameters, window_px: float) -> Surface:
    left, right = pair.half
    at = (round(pair.point_px[0] / 2), round(pair.point_px[1] / 2))
    reach = parameters.disparity_max_px // 2
    vertical = (parameters.disparity_max_vertical_px + 1) // 2
    return correlate(left, right, at, window_px / 2, (-reach, reach), (-vertical, vertical))


def _decide(
    pair: FoveaPair,
    parameters: DisparityParameters,
    surfaces: list[Surface],
    windows_px: tuple[float, ...],
    scale: int,
) -> Match:
    """Let each window choose among what the smaller ones left over; `scale` is full-resolution pixels per pixel."""
    if surfaces[-1].texture.signal < parameters.disparity_minimum_texture:
        return _nothing(DisparityStatus.NO_TEXTURE, "too little structure at the point", windows_px[-1])
    candidates: list[int] | None = None
    best: Match | None = None
    for window_px, surface in zip(windows_px, surfaces, strict=True):
        visible = _visible(pair, surface, scale)
        if not visible.any():
            return _nothing(DisparityStatus.OUT_OF_RANGE, "every match would lie outside the right image", window_px)
        profile = np.where(visible, surface.profile, -1.0)
        candidates = _candidates(profile, candidates, parameters.disparity_uniqueness)
        if surface.texture.signal < parameters.disparity_minimum_texture:
            continue
        match = _judge(pair, parameters, surface, profile, candidates, window_px, scale)
        if match.sure:
            return match
        if best is None or match.evidence.confidence >= best.evidence.confidence:
            best = match
    assert best is not None
    return best


def _visible(pair: FoveaPair, surface: Surface, scale: int) -> NDArray[np.bool_]:
    disparities = (surface.first_d + np.arange(surface.zncc.shape[1])) * scale
    x = pair.point_px[0] - disparities
    return (x >= 0) & (x <= pair.left.shape[1] - 1)


def _candidates(profile: NDArray[np.float32], before: list[int] | None, uniqueness: float) -> list[int]:
    """Return the columns of the peaks that this window cannot tell from its best, best first."""
    padded = np.pad(profile, 1, constant_values=-2.0)
    peaks = np.flatnonzero((profile >= padded[:-2]) & (profile >= padded[2:]) & (profile > 0.0))
    if before is not None:
        peaks = np.array([p for p in peaks if any(abs(p - b) <= 2 for b in before)], int)
    if len(peaks) == 0:
        return [] if before is None else before
    top = float(profile[peaks].max())
    kept = peaks[profile[peaks] ** 2 >= 1.0 - _unexplained(top, uniqueness)]
    return [int(p) for p in kept[np.argsort(-profile[kept])]]


def _unexplained(correlation: float, uniqueness: float) -> float:
    """Return the share of grey-level variance that a rival may leave unexplained and still count as fitting as well.

    30 % more than the best leaves, for noise, and what sampling and perspective leave unexplained of a true match.
    """
    return (1.0 - correlation**2) * 1.3 + (1.0 - uniqueness**2)


def _judge(
    pair: FoveaPair,
    parameters: DisparityParameters,
    surface: Surface,
    profile: NDArray[np.float32],
    candidates: list[int],
    window_px: float,
    scale: int,
) -> Match:
    """Weigh the best candidate of one window."""
    if not candidates:
        return _nothing(DisparityStatus.NO_MATCH, "nothing in the right image fits", window_px)
    i, j, value = surface.peak_near(surface.first_d + candidates[0], 0)
    horizontal, vertical = surface.subpixel(i, j)
    rival = max((float(profile[c]) for c in candidates[1:] if abs(c - i) * scale > 3), default=0.0)
    returned = _left_right_error(pair, surface, i, j, window_px, scale, parameters)
    evidence = Evidence(
        correlation=value,
        independent=surface.texture.independent,
        places=float(surface.zncc.size),
        rival=rival,
        left_right_px=returned,
    )
    sigma_px = scale * deviation_px(surface, value)
    guess = (horizontal * scale, vertical * scale, sigma_px, window_px, evidence)
    rows, columns = surface.zncc.shape
    if not evidence.beyond_chance:
        return Match(*guess, DisparityStatus.NO_MATCH, f"the best correlation, {value:.2f}, may be chance")
    if len(candidates) > 1:
        return Match(*guess, DisparityStatus.AMBIGUOUS, f"{len(candidates)} disparities fit about as well")
    if i in (0, columns - 1) or (rows > 1 and j in (0, rows - 1)):
        return Match(*guess, DisparityStatus.OUT_OF_RANGE, "the best fit lies at the edge of the searched range")
    if returned > parameters.disparity_left_right_px:
        return Match(
            *guess, DisparityStatus.NO_MATCH, f"matching back from the right image misses by {returned:.1f} px"
        )
    return Match(*guess, DisparityStatus.OK, "")


def deviation_px(surface: Surface, correlation: float) -> float:
    """Return the standard deviation of a correlation peak's place, in pixels of the surface's resolution.

    What the match leaves unexplained is taken as white noise over the window; the texture's correlation length follows
    from its number of independent samples (Cramer-Rao bound for a shift).
    """
    signal = max(surface.texture.signal, 1e-3)
    unexplained = math.sqrt(max(1.0 - correlation**2, 1e-4))
    length = max(2.0 / math.sqrt(max(surface.texture.independent, 1e-3)), 1e-3)
    radius = radius_of(1.0) / REACH_IN_SIGMAS
    return float(unexplained * length * radius * surface.texture.deviation / signal / 2.0)


def _left_right_error(
    pair: FoveaPair, surface: Surface, i: int, j: int, window_px: float, scale: int, parameters: DisparityParameters
) -> float:
    """Match back from the right image over the same range; return how far from the point it ends, in full pixels."""
    left, right = (pair.full, pair.half)[scale - 1]
    d, v = surface.first_d + i, surface.first_v + j
    at = (round(pair.point_px[0] / scale) - d, round(pair.point_px[1] / scale) - v)
    back = _reverse_range(pair, at, d, surface, left, right, window_px / scale)
    if back is None:
        return math.inf
    reverse = correlate(right, left, at, window_px / scale, back, (v - 1, v + 1), sign=1)
    column = int(reverse.profile.argmax())
    return abs(back[0] + column - d) * float(scale)


def _reverse_range(
    pair: FoveaPair, at: tuple[int, int], d: int, surface: Surface, left: Strip, right: Strip, sigma: float
) -> tuple[int, int] | None:
    """Return the range of disparities whose left windows lie inside the crop, at most the forward range's width."""
    radius = radius_of(sigma)
    if at[0] - right.x0 < radius or at[0] - right.x0 + radius >= right.grey.shape[1]:
        return None
    half = min(surface.zncc.shape[1] // 2, 12)
    low = max(d - half, int(left.x0) + radius - at[0])
    high = min(d + half, int(left.x0) + left.grey.shape[1] - 1 - radius - at[0])
    return (low, high) if low <= d <= high else None


def _nothing(status: DisparityStatus, reason: str, window_px: float) -> Match:
    return Match(math.nan, math.nan, math.nan, window_px, Evidence.nothing(), status, reason)
