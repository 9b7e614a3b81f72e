"""How likely a candidate of `semi_global` is, and how sure and how precise the answer: three small fitted models.

`bench/photos_disparity_fit.py` fits the constants to pairs with ground truth and prints them.
"""

import math
from dataclasses import dataclass

CHOICE = (-2.81, 1.16, 3.84, 2.94)
"""Conditional logit of a candidate against none: bias, then the weights of `Support` in its order."""

CONFIDENCE = (-6.39, 0.93, 1.61, 0.74, 1.95, -0.57, -0.55)
"""Logistic model of an error of at most 2 px: bias, then the weights of `Evidence.terms`."""

SIGMA = (1.03, 0.68, 0.41)
"""Log-linear quantile of the error that two deviations hold, halved: bias, then the weights of `Evidence.scales`."""

_BACK_PX = 2.0
_LEAST_OWN_CORRELATION, _LARGEST_OWN_SIGMA_PX, _LEAST_OWN_SHARE = 0.95, 0.1, 0.2
_WITHOUT_FIT_PX = 0.5  # stands for the deviation of the fit, and its distance from the plane, where nothing was fitted
_FINEST_PX = 0.003
_OFF_PLANE_PX = 0.1


@dataclass(frozen=True)
class Support:
    """What speaks for a candidate before it is measured, from 0 to 1 each.

    `agrees` says whether the strip's matching gives the point this disparity, `near_share` to which share of the pixels
    about it; `column` is the tall window's correlation, the mean of the others' where that has no texture.
    """

    agrees: float
    near_share: float
    column: float


@dataclass(frozen=True)
class Evidence:
    """What speaks for the candidate that was measured.

    `score` is its log odds against none, `back_px` how far matching back from the right image misses it and `own_share`
    the share of the pixels about the point that lie on its surface. `fit_sigma_px` is the standard deviation of its
    affine fit, `fit_correlation` the correlation there and `off_plane_px` how far it lies from the plane of the
    surface; NaN, 0 and NaN where the fit did not converge.
    """

    score: float
    back_px: float
    own_share: float
    fit_sigma_px: float
    fit_correlation: float
    off_plane_px: float

    @property
    def own_pixels_decide(self) -> bool:
        """True if the surface's own pixels fit too well for chance, however small it is in every window."""
        fits = self.fit_correlation >= _LEAST_OWN_CORRELATION and self.fit_sigma_px <= _LARGEST_OWN_SIGMA_PX
        return fits and self.own_share >= _LEAST_OWN_SHARE and self.back_px <= _BACK_PX

    @property
    def terms(self) -> tuple[float, ...]:
        """What the confidence depends on."""
        returns = float(self.back_px <= _BACK_PX)
        fit, off = self.scales
        return (
            self.score,
            returns,
            self.own_share,
            self.fit_correlation,
            off,
            fit,
        )

    @property
    def scales(self) -> tuple[float, float]:
        """What the standard deviation depends on."""
        fit, off = (one if math.isfinite(one) else _WITHOUT_FIT_PX for one in (self.fit_sigma_px, self.off_plane_px))
        return math.log(math.hypot(fit, _FINEST_PX)), math.log(off + _OFF_PLANE_PX)


def choice_score(support: Support) -> float:
    """Return the log odds of a candidate against none of the candidates."""
    return _weighed(CHOICE, (support.agrees, support.near_share, support.column))


def confidence(evidence: Evidence) -> float:
    """Return the share of answers with this evidence that lie within 2 px of the truth."""
    return 1.0 / (1.0 + math.exp(-_weighed(CONFIDENCE, evidence.terms)))


def sigma_px(evidence: Evidence) -> float:
    """Return the standard deviation of the disparity [px]: half of what about 94 % of like answers err by at most."""
    return math.exp(_weighed(SIGMA, evidence.scales))


def _weighed(model: tuple[float, ...], terms: tuple[float, ...]) -> float:
    return model[0] + sum(w * x for w, x in zip(model[1:], terms, strict=True))
