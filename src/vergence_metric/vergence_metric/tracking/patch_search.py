"""A search for a template in an image: correlation, what it says for each place, and the cost of places far off."""

from functools import lru_cache
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_metric.disparity.correlation import peak_offset
from vergence_metric.disparity.fovea_pair import cut
from vergence_metric.disparity.protocol import Image
from vergence_metric.tracking.eye_view import Pixel

Sides = tuple[int, int, int, int]

_POINT_PRIOR = 1.0  # evidence by which a place at the rim of its search is worse
_LARGEST_CORRELATION = 1.001  # a masked one is greater where nothing is seen
_NOISE = 0.002  # share of its variance that an image taken again does not explain


class Template(NamedTuple):
    """What is looked for, (h, w) uint8, how far it reaches on each side [its px], and which of it counts, None: all."""

    image: Image
    mask: Image | None
    sides: Sides


def best_near(image: Image, template: Template, place: Pixel, reach: int) -> tuple[Pixel, float, float]:
    """Return the sub-pixel place within reach where the template fits best, its correlation, and that at `place`.

    Of places that fit alike the nearest counts.
    """
    (left, top, _, _), (height, width) = template.sides, template.image.shape
    x0, y0 = round(place[0]) - left - reach, round(place[1]) - top - reach
    area = cut(image, x0, y0, width + 2 * reach, height + 2 * reach)
    surface = correlation(area, template)
    nearest = evidence_of(surface) - distance_cost(surface.shape, _POINT_PRIOR)
    j, i = divmod(int(nearest.argmax()), surface.shape[1])
    di, dj = peak_offset(nearest, i, j)
    return (x0 + left + i + di, y0 + top + j + dj), float(surface[j, i]), float(surface[reach, reach])


def evidence_of(similarity: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return how much correlations say for their places: a place that leaves half as much unexplained has 0.7 more."""
    return np.asarray(-np.log(1.0 + _NOISE - similarity), np.float32)


def correlation(area: Image, template: Template) -> NDArray[np.float32]:
    """Return the correlation (rows, columns) of a template with every place of an area (h, w); -1 where it has none."""
    how = cv2.TM_CCOEFF_NORMED
    surface = np.asarray(cv2.matchTemplate(area, template.image, how, mask=template.mask), np.float32)
    if template.mask is not None:
        surface[~(np.abs(surface) <= _LARGEST_CORRELATION)] = -1.0  # or not finite
    return surface


@lru_cache(maxsize=32)
def distance_cost(shape: tuple[int, ...], prior: float, scale: int = 1) -> NDArray[np.float32]:
    """Return by how much each place of a search is worse for its distance from the expected one: `prior` at the rim.

    A place of an image that was reduced by `scale` is the mean of so many pixels: the middle one lies to the right of
    the expected pixel, and below it.
    """
    half = 0.5 * (scale - 1) / scale
    reaches = (max((n - 1) // 2, 1) for n in shape)
    down, across = (((np.arange(n) - n // 2 + half) / reach) ** 2 for n, reach in zip(shape, reaches, strict=True))
    cost = np.asarray(np.float32(prior) * np.add.outer(down, across), np.float32)
    cost.flags.writeable = False
    return cost
