"""Disparity of a point by semi-global matching of a strip about it, refined on the point's own surface.

Smoothness across the strip and the correlation of several windows name candidates; a conditional logit weighs them
against one another and against none of them. The likeliest is measured by the affine model on the pixels that lie on
its surface, matched back from the right image, and given a confidence by a logistic model of what speaks for it.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vergence_metric.disparity.affine import Fit, grow
from vergence_metric.disparity.candidates import Profile, column, profiles, repetitions, vertical_px
from vergence_metric.disparity.correlation import radius_of
from vergence_metric.disparity.fovea_pair import FoveaPair
from vergence_metric.disparity.lighting import lit_alike
from vergence_metric.disparity.own_surface import OwnSurface, own_surface
from vergence_metric.disparity.parameters import DisparityParameters
from vergence_metric.disparity.protocol import (
    Candidate,
    Disparity,
    DisparityEstimator,
    DisparityStatus,
    Image,
    Point,
    Surface,
)
from vergence_metric.disparity.search import pair_about
from vergence_metric.disparity.semi_global_model import Evidence, Support, choice_score, confidence, sigma_px
from vergence_metric.disparity.strip_matching import LARGEST_HALF_PX, coarse, fine, returned

_SAME_PX = 2.0  # disparities this close are one candidate, and one surface
_PEAKS = 2  # of each window's correlation are candidates
_MARGIN_PX = 4
_SURROUNDINGS_PX = 28  # half side of the square whose disparities are searched at full resolution
_OUTLIERS = 0.03  # share of those disparities that may be wrong, at either end
_NEAR_PX = 4  # half side of the square in which support is counted
_OWN_PX = 8  # half side of the square in which the point's surface is counted
_BESIDE_SHARE = 0.1  # of the pixels about the point that make another surface a candidate
_BACK_MARGIN_PX = 8
_FURTHEST_PX, _VAGUE_PX = 0.75, 0.12  # a fit further from the plane of its surface, and vaguer, is not taken
_LEAST_DEVIATIONS = -1.0  # below what chance gives, for the strip's smoothness speaks for a point too
_SURE_DEVIATIONS = 0.5  # but a strip looks smooth whatever it shows: sure is only what does better than chance
_LEAST_DEVIATIONS_FLAT = 1.0  # where only one window has texture: a wall's shading is smooth, and matches anywhere
_ELSEWHERE_DEVIATIONS = -1.5  # that the tall window may reach in other places, where it decides alone
_LEAST_CONFIDENCE = 0.3
_UNSURE = 0.5  # confidence of what is more likely wrong than right, at most
_MOST_REPEATED = 4
_UPRIGHT_CONFIDENCE = 0.7  # of what the tall window alone sees: right wherever the truth was known, but seldom seen


@dataclass(frozen=True)
class Choice:
    """One candidate: its disparity [px], what named it, what supports it and its log odds against none."""

    disparity_px: float
    found_by: str
    support: Support
    score: float


class SemiGlobalEstimator(DisparityEstimator):
    """Semi-global matching about the point, refined on the point's own surface; see the module."""

    name = "semi_global"

    def __init__(self, parameters: DisparityParameters) -> None:
        self._parameters = parameters

    def estimate_at(self, left: Image, right: Image, point_px: Point, expected_px: float | None) -> Disparity:
        """Return the disparity at a point; see DisparityEstimator."""
        pair = pair_about(left, right, point_px, self._parameters)
        layers = profiles(pair, self._parameters)
        if not any(layer.visible for layer in layers):
            reason = "every match would lie outside the right image"
            return Disparity.none(DisparityStatus.OUT_OF_RANGE, reason, self.name, point_px)
        if not any(layer.textured for layer in layers):
            reason = "too little structure at the point"
            return Disparity.none(DisparityStatus.NO_TEXTURE, reason, self.name, point_px)
        if expected_px is not None and abs(expected_px) <= self._parameters.max_px:
            near = PointMatching(pair, layers, self._parameters, expected_px).answer(self.name)
            if near.confidence > _UNSURE or near.status is DisparityStatus.AMBIGUOUS:
                return near
        return PointMatching(pair, layers, self._parameters).answer(self.name)


class PointMatching:
    """What both images say about one point: over the whole range, or about an expected disparity [px]."""

    def __init__(
        self,
        pair: FoveaPair,
        layers: list[Profile],
        parameters: DisparityParameters,
        expected_px: float | None = None,
    ) -> None:
        self._pair, self._layers, self._parameters, self._expected_px = pair, layers, parameters, expected_px
        self._at = (round(pair.point_px[0]), round(pair.point_px[1]))
        self._vertical = vertical_px(layers)
        self._right = lit_alike(pair, layers, LARGEST_HALF_PX + abs(self._vertical))
        guess, self._span = self._about_coarse() if expected_px is None else self._about(expected_px)
        reach = parameters.max_px
        searched = (-reach, reach) if expected_px is None else self._span
        self._column = column(pair, self._vertical, (max(searched[0], -reach), min(searched[1], reach)), parameters)
        self._fine = fine(pair.left, self._right, pair.point_px, self._vertical, self._span)
        self.choices = self._choices(guess)
        """The candidates, as found."""

    def answer(self, name: str) -> Disparity:
        """Return the disparity of the likeliest candidate, how sure it is, and all candidates."""
        point = self._pair.point_px
        if not self.choices:
            return Disparity.none(DisparityStatus.NO_MATCH, "nothing in the right image fits", name, point)
        best = self.likeliest()
        evidence, horizontal, vertical, surface = self.measure(best)
        repeated = self.repeated(best)
        sure = confidence(evidence)
        status, reason = self._status(best, evidence, sure, repeated)
        if status is DisparityStatus.NO_MATCH and (upright := self._upright()) is not None:
            return self._alone(upright, self._ranked(best, []), name)
        if status is not DisparityStatus.OK or not self.beyond_chance(best, evidence, _SURE_DEVIATIONS):
            sure = min(sure, _UNSURE)
        ranked = self._ranked(best, repeated)
        sigma = sigma_px(evidence)
        return Disparity(horizontal, vertical, sigma, sure, status, reason, name, point, ranked, surface)

    def likeliest(self) -> Choice:
        """Return what the strip gives the point, if it is likelier than none, else the candidate of the highest score.

        Only the strip tells a small thing's pixels from those behind it; every window's correlation mixes them. Where a
        disparity is expected, those about it go first.
        """
        near = self.choices
        if self._expected_px is not None:
            track = self._parameters.track_px
            near = [one for one in near if abs(one.disparity_px - self._expected_px) <= track] or near
        own = [one for one in near if one.support.agrees and one.score > 0.0]
        return max(own or near, key=lambda one: one.score)

    def measure(self, choice: Choice) -> tuple[Evidence, float, float, Surface]:
        """Return what speaks for a candidate, its disparities across and down by the fit on its surface, and that."""
        windows = self._parameters.windows_px
        own = own_surface(self._fine, self._at, choice.disparity_px, radius_of(windows[-1]) + 1)
        start = (own.disparity_px, float(self._vertical), windows[0])
        fit = grow(self._pair, *start, self._parameters, (own.slope_x, own.slope_y), own.support)
        evidence = Evidence(
            score=choice.score,
            back_px=abs(self._matched_back(choice.disparity_px) - choice.disparity_px),
            own_share=own.share(_OWN_PX),
            fit_sigma_px=fit.sigma_px if fit else math.nan,
            fit_correlation=fit.correlation if fit else 0.0,
            off_plane_px=abs(fit.horizontal_px - own.disparity_px) if fit else math.nan,
        )
        slopes = np.array([[own.slope_x, own.slope_y], [0.0, 0.0]]) if fit is None else np.eye(2) - fit.affine
        surface = Surface(slopes, own.support.grey, (round(own.support.x0), round(own.support.y0)))
        return evidence, *self._kept(own, fit), surface

    def _alone(self, choice: Choice, others: tuple[Candidate, ...], name: str) -> Disparity:
        """Return the answer that the tall window gives by itself, before the other candidates."""
        evidence, horizontal, vertical, surface = self.measure(choice)
        d, sure = choice.disparity_px, _UPRIGHT_CONFIDENCE
        ranked = (Candidate(d, sure, choice.found_by), *(one for one in others if abs(one.disparity_px - d) > _SAME_PX))
        sigma, status, point = sigma_px(evidence), DisparityStatus.OK, self._pair.point_px
        return Disparity(horizontal, vertical, sigma, sure, status, "", name, point, ranked, surface)

    def _upright(self) -> Choice | None:
        """Return the candidate of the tall window where that fits in one place and nearly nowhere else, else None.

        It is a thin upright thing before a background, with which the strip has filled its pixels. In all of the range:
        about an expected disparity there is no elsewhere.
        """
        peaks = [] if self._expected_px is not None or not self._column.textured else self._column.peaks.tolist()
        if not peaks or self._column.deviations(peaks[0]) < 0.0:
            return None
        others = (self._column.deviations(d) for d in peaks[1:] if abs(d - peaks[0]) > 2.0 * _SAME_PX)
        if max(others, default=-math.inf) > _ELSEWHERE_DEVIATIONS:
            return None
        near = self._fine.about(*self._at, _NEAR_PX)
        support = self._support(float(peaks[0]), self._fine.at(*self._at), near)
        return Choice(float(peaks[0]), "tall window alone", support, choice_score(support))

    def repeated(self, choice: Choice) -> list[float]:
        """Return the disparities that a repeated texture makes as good as this candidate's."""
        return repetitions(self._pair, choice.disparity_px, self._layers, self._parameters)

    def beyond_chance(self, choice: Choice, evidence: Evidence, least: float = _LEAST_DEVIATIONS) -> bool:
        """Return whether the candidate is likelier than none, and fits better than unrelated images would.

        By `least` standard deviations in some window, or by its own pixels alone.
        """
        found = [layer.deviations(choice.disparity_px) for layer in (*self._layers, self._column) if layer.textured]
        if len(found) == 1:
            return choice.score > 0.0 and found[0] >= _LEAST_DEVIATIONS_FLAT
        return choice.score > 0.0 and (max(found) >= least or evidence.own_pixels_decide)

    def _about(self, expected_px: float) -> tuple[float, tuple[int, int]]:
        track = self._parameters.track_px
        return expected_px, self._with_margin(expected_px - track, expected_px + track)

    def _about_coarse(self) -> tuple[float, tuple[int, int]]:
        """Return the strip's disparity at half resolution, and the range of those around: what to search finely."""
        reach = self._parameters.max_px
        patch = coarse(self._pair.left, self._right, self._pair.point_px, self._vertical, reach)
        guess, near = patch.at(*self._at), patch.about(*self._at, _SURROUNDINGS_PX)
        ordered, outliers = np.sort(near), int(_OUTLIERS * near.size)
        low, high = (float(ordered[outliers]), float(ordered[-1 - outliers])) if near.size else (0.0, 0.0)
        if math.isfinite(guess):
            low, high = min(low, guess), max(high, guess)
        return guess, self._with_margin(low, high)

    def _with_margin(self, low: float, high: float) -> tuple[int, int]:
        reach = self._parameters.max_px + 2 * _MARGIN_PX
        return max(math.floor(low) - _MARGIN_PX, -reach), min(math.ceil(high) + _MARGIN_PX, reach)

    def _choices(self, guess: float) -> list[Choice]:
        own = self._fine.at(*self._at)
        named = [(own, "strip at full resolution")]
        named.append((guess, "strip at half resolution" if self._expected_px is None else "expected"))
        named.append((self._beside(own), "surface beside it"))
        for layer in self._layers:
            if layer.textured:
                named += [(float(d), f"window of {layer.window_px:g} px") for d in layer.peaks[:_PEAKS]]
        if self._column.textured:
            named += [(float(d), "tall window") for d in self._column.peaks[:_PEAKS]]
        near = self._fine.about(*self._at, _NEAR_PX)
        found: list[Choice] = []
        for d, name in named:
            inside = math.isfinite(d) and abs(d) <= self._parameters.max_px
            if inside and all(abs(d - one.disparity_px) > _SAME_PX for one in found):
                support = self._support(d, own, near)
                found.append(Choice(d, name, support, choice_score(support)))
        return found

    def _beside(self, own: float) -> float:
        """Return the disparity of the other surface in the strip about the point, NaN if it has only one."""
        near = self._fine.about(*self._at, _OWN_PX)
        others = near[np.abs(near - own) > 2.0 * _SAME_PX]
        return float(np.median(others)) if others.size > _BESIDE_SHARE * near.size else math.nan

    def _support(self, d: float, own: float, near: NDArray[np.float32]) -> Support:
        """Return what supports a candidate, by the strip's disparities at the point and near it (n) [px]."""
        correlated = [self._column] if self._column.textured else [one for one in self._layers if one.textured]
        return Support(
            agrees=float(abs(own - d) <= _SAME_PX),
            near_share=np.count_nonzero(np.abs(near - d) <= _SAME_PX) / near.size if near.size else 0.0,
            column=sum(max(one.at(d), 0.0) for one in correlated) / len(correlated),
        )

    def _matched_back(self, d: float) -> float:
        span = (min(self._span[0], math.floor(d) - _BACK_MARGIN_PX), max(self._span[1], math.ceil(d) + _BACK_MARGIN_PX))
        at = (self._pair.point_px[0] - d, self._pair.point_px[1] - self._vertical)
        return returned(self._pair.left, self._right, at, self._vertical, span)

    def _kept(self, own: OwnSurface, fit: Fit | None) -> tuple[float, float]:
        """Return horizontal and vertical disparity: those of the affine fit, where it stays on the surface."""
        if fit is None:
            return own.disparity_px, float(self._vertical)
        if abs(fit.horizontal_px - own.disparity_px) > _FURTHEST_PX and fit.sigma_px > _VAGUE_PX:
            return own.disparity_px, float(self._vertical)
        return fit.horizontal_px, fit.vertical_px

    def _status(
        self, best: Choice, evidence: Evidence, sure: float, repeated: list[float]
    ) -> tuple[DisparityStatus, str]:
        if not self.beyond_chance(best, evidence):
            return DisparityStatus.NO_MATCH, "the best match may be chance"
        if repeated:
            reason = f"the texture repeats: {len(repeated) + 1} disparities fit about as well"
            return DisparityStatus.AMBIGUOUS, reason
        if abs(best.disparity_px) > self._parameters.max_px - _SAME_PX:
            return DisparityStatus.OUT_OF_RANGE, "the best fit lies at the edge of the searched range"
        if sure > _LEAST_CONFIDENCE:
            return DisparityStatus.OK, ""
        if not evidence.back_px <= _SAME_PX:
            return DisparityStatus.NO_MATCH, "matching back from the right image leads elsewhere"
        return DisparityStatus.NO_MATCH, f"only {100 * evidence.own_share:.0f} % of the pixels about it agree"

    def _ranked(self, best: Choice, repeated: list[float]) -> tuple[Candidate, ...]:
        """Return all candidates, the likeliest first; repetitions are as likely as what they repeat."""
        choices = list(self.choices)
        for d in repeated[:_MOST_REPEATED]:
            if all(abs(d - one.disparity_px) > _SAME_PX for one in choices):
                choices.append(replace(best, disparity_px=d, found_by="repeated texture"))
        odds = [math.exp(one.score) for one in choices]
        total = 1.0 + sum(odds)
        ranked = [Candidate(c.disparity_px, o / total, c.found_by) for c, o in zip(choices, odds, strict=True)]
        return tuple(sorted(ranked, key=lambda one: -one.likelihood))
