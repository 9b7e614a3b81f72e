"""What the disparity of a point may be: correlation peaks of several windows, and what the strip's matching says."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from vergence_metric.disparity.correlation import Surface, correlate, radius_of
from vergence_metric.disparity.fovea_pair import FoveaPair
from vergence_metric.disparity.parameters import DisparityParameters

_HALVED_FROM_PX = 8.0  # windows of this deviation or more are correlated at half resolution
_APART_PX = 4.0  # candidates this far apart are rivals
_AS_GOOD = 1.4  # a rival that leaves up to this factor more unexplained is as good
_AS_ITSELF = 1.15  # the same, of what the texture leaves unexplained of itself there
_REPEATS = 0.93  # self-correlation of a repeated texture without noise
_CLEAR = 3.0  # signal over noise from which a window can tell a repetition
_WIDER = (2.0, 4.0)  # times the largest window
_MOST_DEVIATIONS = 12.0
_COLUMN_ROWS_PX = 2  # rows searched on either side of the vertical disparity
COLUMN_PX = (2.5, 12.0)
"""Standard deviations of the tall window, across and down."""
_UNEXPLAINED = 0.1  # share of the variance that half resolution may leave unexplained of an exact repetition
_VERTICAL_COST = 0.05  # per pixel, in logarithms of what is unexplained: rows are roughly aligned


@dataclass(frozen=True)
class Profile:
    """Correlation of one window with the right image over the whole range, a column for each `scale` px of disparity.

    Columns whose point lies outside the right image hold -1.
    """

    window_px: float
    scale: int
    first_px: int
    values: NDArray[np.float32]
    textured: bool
    surface: Surface

    @property
    def visible(self) -> bool:
        """True if some match would lie inside the right image."""
        return bool((self.values > -1.0).any())

    def at(self, d: float) -> float:
        """Return the best correlation within a column of a disparity, -1 outside the range."""
        i = round((d - self.first_px) / self.scale) + 1
        return self._best_near[i] if 0 <= i < len(self._best_near) else -1.0

    @cached_property
    def _best_near(self) -> list[float]:
        """The best value within a column of each column, from one before the first to one after the last."""
        padded = np.full(len(self.values) + 4, -1.0, self.values.dtype)
        padded[2:-2] = self.values  # np.pad takes ten times as long
        best: list[float] = np.maximum(np.maximum(padded[:-2], padded[1:-1]), padded[2:]).tolist()
        return best

    @cached_property
    def peaks(self) -> NDArray[np.intp]:
        """The disparities [px] of the positive local maxima, best first."""
        top, rises = self.values > 0.0, self.values[1:] >= self.values[:-1]
        top[1:] &= rises
        top[:-1] &= ~rises
        (found,) = top.nonzero()
        return self.first_px + self.scale * found[(-self.values[found]).argsort()]

    def deviations(self, d: float) -> float:
        """Return how far the correlation lies above the best that chance gives, in standard deviations (Fisher's z)."""
        chance = math.sqrt(2.0 * math.log(self.surface.zncc.size))
        samples = max(self.surface.texture.independent - 3.0, 0.0)
        found = math.atanh(min(max(self.at(d), 0.0), 0.995)) * math.sqrt(samples) - chance
        return min(max(found, -_MOST_DEVIATIONS), _MOST_DEVIATIONS)


def profiles(pair: FoveaPair, parameters: DisparityParameters) -> list[Profile]:
    """Correlate every window over the whole range of disparities, horizontal and vertical."""
    return [_profile(pair, window_px, parameters) for window_px in parameters.windows_px]


def _profile(
    pair: FoveaPair, window_px: float, parameters: DisparityParameters, at_px: Sequence[float] = ()
) -> Profile:
    """Correlate a window over the whole range, or only about some disparities."""
    scale = 1 if window_px < _HALVED_FROM_PX else 2
    left, right = pair.full if scale == 1 else pair.half
    at = (round(pair.point_px[0] / scale), round(pair.point_px[1] / scale))
    reach, vertical = parameters.max_px // scale, -(-parameters.max_vertical_px // scale)
    searched = _about(at_px, scale, reach) if at_px else (-reach, reach)
    surface = correlate(left, right, at, window_px / scale, searched, (-vertical, vertical))
    return _profile_of(surface, pair, window_px, scale, parameters)


def _about(at_px: Sequence[float], scale: int, reach: int) -> tuple[int, int]:
    """Return the columns that `Profile.at` looks at for some disparities, the first and the last, within a reach."""
    columns = [min(max(round(d / scale), -reach), reach) for d in at_px]
    first = (min(columns) - 1) // 2 * 2  # an even one, from which half columns are rounded alike
    return max(first, -reach), min(max(columns) + 1, reach)


def _profile_of(
    surface: Surface, pair: FoveaPair, window_px: float, scale: int, parameters: DisparityParameters
) -> Profile:
    values, x = surface.profile, pair.point_px[0] / scale - surface.first_d
    # Column i is that of the point's place x - i in the right image.
    values[: max(math.ceil(x - (pair.left.shape[1] - 1) / scale), 0)] = -1.0
    values[max(math.floor(x) + 1, 0) :] = -1.0
    textured = surface.texture.signal >= parameters.min_texture
    return Profile(window_px, scale, surface.first_d * scale, values, textured, surface)


def column(pair: FoveaPair, vertical_px: int, span_px: tuple[int, int], parameters: DisparityParameters) -> Profile:
    """Correlate a tall, narrow window: the pixels of a thin upright thing, without what lies beside it.

    Every other window mixes a pen, a pole or a cable with its background. `span_px` are the first and the last
    disparity, `vertical_px` is that of the surroundings.
    """
    at = (round(pair.point_px[0]), round(pair.point_px[1]))
    rows = (vertical_px - _COLUMN_ROWS_PX, vertical_px + _COLUMN_ROWS_PX)
    surface = correlate(*pair.full, at, COLUMN_PX[0], span_px, rows, down=COLUMN_PX[1])
    return _profile_of(surface, pair, COLUMN_PX[0], 1, parameters)


def vertical_px(layers: Sequence[Profile]) -> int:
    """Return the vertical disparity of the surroundings: where the larger windows fit best, small ones preferred."""
    large = [one for one in layers if one.textured and one.scale > 1] or list(layers[-1:])
    v = (large[0].surface.first_v + np.arange(large[0].surface.zncc.shape[0])) * large[0].scale
    cost = _VERTICAL_COST * np.abs(v)[:, None]
    for layer in large:
        seen = np.where(layer.values < 0.0, 0.0, np.maximum(layer.surface.zncc, 0.0))
        cost = cost + np.log(1.0 - seen**2 + _UNEXPLAINED) / len(large)
    return int(v[int(cost.argmin()) // cost.shape[1]])


def repetitions(pair: FoveaPair, d: float, layers: Sequence[Profile], parameters: DisparityParameters) -> list[float]:
    """Return the disparities that the texture's own repetition makes as good as `d`: no window can tell them apart.

    A rival counts only where the left image resembles itself at that distance: what lies beside a depth edge fits well
    elsewhere too, but repeats nothing. As edges resemble themselves along their way, windows larger than the largest
    have the last word: where a repetition ends, they tell.
    """
    textured = [layer for layer in layers if layer.textured]
    if not textured:
        return []
    rivals = [float(r) for r in textured[0].peaks if _APART_PX < abs(r - d) <= parameters.max_px]
    for layer in textured:
        least = max(_AS_GOOD * _unexplained(layer.at(d)), _AS_ITSELF * _unexplained(_REPEATS))
        rivals = [r for r in rivals if _unexplained(layer.at(r)) <= least]
    for layer in textured:
        rivals = _repeated(pair, d, rivals, layer)
    for window_px in (factor * parameters.windows_px[-1] for factor in _WIDER):
        if not rivals:
            break
        wide = replace(pair, margin_px=radius_of(window_px) + 4)
        rivals = _repeated(wide, d, rivals, _profile(wide, window_px, parameters, [d, *rivals]))
    return rivals


def _repeated(pair: FoveaPair, d: float, rivals: list[float], layer: Profile) -> list[float]:
    """Return the rivals at which a window fits as well as at `d`, or as well as the texture fits itself there."""
    texture = layer.surface.texture
    if not rivals or texture.signal < _CLEAR * texture.noise:
        return rivals
    itself, own = _self_correlation(pair, layer, [r - d for r in rivals]), _AS_GOOD * _unexplained(layer.at(d))
    least = _REPEATS * (texture.signal / max(texture.deviation, 1e-3)) ** 2  # noise is not repeated
    fits = [(r, itself.at(r - d)) for r in rivals]
    # A repetition that falls between pixels fits no better than the texture fits itself there.
    return [
        r for r, fit in fits if fit >= least and _unexplained(layer.at(r)) <= max(own, _AS_ITSELF * _unexplained(fit))
    ]


def _self_correlation(pair: FoveaPair, layer: Profile, shifts_px: Sequence[float]) -> Profile:
    """Correlate a window with its own row in the left image, about some shifts."""
    left = pair.full[0] if layer.scale == 1 else pair.half[0]
    at = (round(pair.point_px[0] / layer.scale), round(pair.point_px[1] / layer.scale))
    sigma, texture = layer.window_px / layer.scale, layer.surface.texture
    searched = _about(shifts_px, layer.scale, pair.reach_px // layer.scale)
    surface = correlate(left, left, at, sigma, searched, (-1, 1), texture=texture)
    return replace(layer, first_px=layer.scale * searched[0], values=surface.profile, surface=surface)


def _unexplained(correlation: float) -> float:
    return 1.0 - max(correlation, 0.0) ** 2 + _UNEXPLAINED
