"""The appearance of a point in the image in which it was asked for, found again after the eye has turned.

Turning a camera about its optical centre warps its image by a homography that the joint angles give, whatever the
depth. What was seen is therefore warped to how it must look now, and only its place is searched, coarse to fine: the
reported angles of hobby servos are off by up to degrees. The wide view says where the eye has turned to, the context
where the point is (beside the wide view's place if it is near and the lens is off its axis), the point itself the rest.
Along an edge or without texture, where a level looks the same everywhere, the place of the level before is kept.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_metric.disparity.correlation import peak_offset
from vergence_metric.disparity.fovea_pair import cut
from vergence_metric.disparity.protocol import Image
from vergence_metric.tracking.eye_view import EyeView, Pixel, distance
from vergence_metric.tracking.reduced import reduced

_WIDE_HALF_PX, _WIDE_SCALE = 160, 4
_WIDE_SIMILARITY = 0.7  # from which the wide view's place is where the context is looked for
_WIDE_REACH_PX = 16  # that parallax may move the point beside it
_OWN_REACH_PX = 8  # the same where the head's geometry says how far it does: the point's own pixels may be few
_CONTEXT_HALF_PX, _CONTEXT_SCALE = 48, 2  # on photographs the smallest that rarely errs
_POINT_HALF_PX = 16
NEVER = -1.0
"""No correlation is below it."""
_ALONE_LEAD = 0.3  # in correlation, over any other place: without its surroundings a point must be unmistakable
_CANDIDATES = 3
_APART_PX = 12.0  # two peaks of the context closer than this are one place
_REFINED_WITHIN_PX = 4
_LEAST_CONTRAST = 1.0  # standard deviation of a template [grey levels]
_AS_ALIKE = 0.2  # difference in evidence below which two places look alike
_PRIOR, _WIDE_PRIOR, _POINT_PRIOR = 0.3, 4.0, 1.0  # evidence by which a place at the rim of its search is worse
_SAME_PX = 2.0  # by which what is in front of or behind a surface may have moved against it, and still count
_MOSTLY_OWN = 128  # of 255
_LEAST_OWN_PX = 60
_LARGEST_CORRELATION = 1.001  # a masked one is greater where nothing is seen
_TAKEN = -99.0  # evidence where a place has been found already
_NOISE = 0.002  # share of its variance that an image taken again does not explain

Sides = tuple[int, int, int, int]
MaskAt = Callable[[int], "Image | None"]
"""The mask (h, w) of a point's own surface at a scale; None where it is not known."""


class Template(NamedTuple):
    """What is looked for, (h, w) uint8, how far it reaches on each side [its px], and which of it counts, None: all."""

    image: Image
    mask: Image | None
    sides: Sides


@dataclass(frozen=True)
class PatchSighting:
    """Where the point is in the image now.

    `similarity` is the correlation of the point's surroundings with the remembered ones, `at_point` that of what lies
    at the point itself (-1 to 1). `spread_px` is how far from it a place looks as much like it: far along an edge.
    """

    pixel: Pixel
    similarity: float
    at_point: float
    spread_px: float = 0.0


class RememberedPatch:
    """What surrounds a pixel of one eye's image, (h, w) uint8, with the eye's view at that moment."""

    def __init__(self, image: Image, view: EyeView, pixel: Pixel) -> None:
        self._view = view
        self.direction = view.direction(pixel)
        self._place = np.array(view.pixel(self.direction))
        self._levels = {scale: reduced(image, scale) for scale in (1, _CONTEXT_SCALE, _WIDE_SCALE)}
        self._reaches = _reaches(image, pixel)

    def find(
        self,
        image: Image,
        view: EyeView,
        direction: NDArray[np.float64],
        reach_px: int,
        alone_below: float = NEVER,
        distance_m: float = math.inf,
        own: MaskAt | None = None,
    ) -> PatchSighting | None:
        """Return where it is, expected within `reach_px` of `direction` (3,) in rig_base; None outside the image.

        Where its surroundings are less similar than `alone_below`, the point itself counts if it is unmistakable.
        `distance_m` is the point's: a lens off its axis has moved, and what is far away lies beside the point now.
        Then only its own surface counts, as `own` returns its mask at a scale.
        """
        expected, height, width = view.pixel(direction), *image.shape
        if not (-reach_px <= expected[0] < width + reach_px and -reach_px <= expected[1] < height + reach_px):
            return None
        far = self._far(view, direction, distance_m)
        own = own if _is_displaced(expected, far) else None
        expected, reach, prior, wide_spread_px = self._about(image, view, expected, far, reach_px)
        size = (_CONTEXT_HALF_PX, _CONTEXT_SCALE)
        places, spread_px = self._places(image, view, expected, reach, size, _CANDIDATES, prior, own)
        if not places:
            return None
        template = self._template(image, view, expected, (_POINT_HALF_PX, 1), own)
        found = []
        for place, similarity in places:
            pixel, at_point, _ = _best_near(image, template, place, _REFINED_WITHIN_PX)
            off = math.hypot(place[0] - expected[0], place[1] - expected[1]) / reach
            evidence = float(_evidence(np.array([similarity, at_point], np.float32)).sum())
            found.append((evidence - prior * off**2, similarity, at_point, pixel))
        _, similarity, at_point, pixel = max(found)
        sighting = PatchSighting(pixel, similarity, at_point, min(spread_px, wide_spread_px))
        if similarity >= alone_below:
            return sighting
        return self._alone(image, view, expected, reach, prior, own) or sighting

    def _alone(
        self, image: Image, view: EyeView, expected: Pixel, reach: int, prior: float, own: MaskAt | None
    ) -> PatchSighting | None:
        """Return where the point itself is, whatever surrounds it now; None unless it is unmistakable.

        A lens that lies off the axes moves as the eye turns: what stands near has another background then.
        """
        places, spread_px = self._places(image, view, expected, reach, (_POINT_HALF_PX, 1), 2, prior, own)
        best, second = [*(similarity for _, similarity in places), 0.0, 0.0][:2]
        if second > best - _ALONE_LEAD:
            return None
        return PatchSighting(places[0][0], best, best, spread_px)

    def _about(
        self, image: Image, view: EyeView, expected: Pixel, far: Pixel, reach_px: int
    ) -> tuple[Pixel, int, float, float]:
        """Return where to search the point, how far and at which prior, by the wide view; the last is its spread.

        The wide view is expected at `far`: most of it is much farther away than a point that is looked at.
        """
        reach = max(reach_px, _WIDE_REACH_PX)
        prior = _PRIOR * (reach / max(reach_px, 1)) ** 2
        wide, spread_px = self._places(image, view, far, reach, (_WIDE_HALF_PX, _WIDE_SCALE), 1, prior)
        if wide and wide[0][1] >= _WIDE_SIMILARITY:
            (x, y), _ = wide[0]
            there = (x + expected[0] - far[0], y + expected[1] - far[1])
            return there, _OWN_REACH_PX if _is_displaced(expected, far) else _WIDE_REACH_PX, _WIDE_PRIOR, spread_px
        return expected, reach, prior, spread_px

    def refine(
        self,
        image: Image,
        view: EyeView,
        pixel: Pixel,
        reach_px: int,
        distance_m: float = math.inf,
        own: MaskAt | None = None,
    ) -> tuple[PatchSighting, float]:
        """Return where the point itself is within `reach_px` of a pixel, and its similarity at that pixel.

        Only its nearest surroundings count: those of a moving object change. `distance_m` and `own` are as in `find`.
        """
        far = self._far(view, view.direction(pixel), distance_m)
        own = own if _is_displaced(pixel, far) else None
        template = self._template(image, view, pixel, (_POINT_HALF_PX, 1), own)
        place, similarity, here = _best_near(image, template, pixel, reach_px)
        return PatchSighting(place, similarity, similarity), here

    def _far(self, view: EyeView, direction: NDArray[np.float64], distance_m: float) -> Pixel:
        """Return where that is now which was far behind the point when the point was seen."""
        return view.pixel(self._view.direction_of(direction, view, distance_m))

    def _template(self, image: Image, view: EyeView, at: Pixel, size: tuple[int, int], own: MaskAt | None) -> Template:
        """Return what must be seen about a pixel now, as far as both images reach, at a size (half side [px], scale).

        With `own` only the point's own surface counts.
        """
        half_px, scale = size
        now = _reaches(image, at)
        reaches = [min(a, b) / scale for a, b in zip(self._reaches, now, strict=True)]
        left, top, right, bottom = (min(max(int(reach) - 1, 3), half_px // scale) for reach in reaches)
        # The point keeps its place; the corners about it move as the eye has turned.
        corners = np.array([(-left, -top), (right, -top), (right, bottom), (-left, bottom)], np.float32)
        turned = view.direction(at)
        middle = np.array(self._view.pixel(turned))
        then = [self._view.pixel(view.direction((at[0] + scale * x, at[1] + scale * y))) for x, y in corners]
        source = (np.array(then) - middle + self._place - 0.5 * (scale - 1)) / scale
        warp = cv2.getPerspectiveTransform(corners + np.array([left, top], np.float32), source.astype(np.float32))
        template = cv2.warpPerspective(
            self._levels[scale],
            warp,
            (left + right + 1, top + bottom + 1),
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_REPLICATE,
        )
        then_own = own(scale) if own is not None else None
        mask = None if then_own is None else _turned(then_own, warp, template.shape)
        return Template(np.asarray(template), mask, (left, top, right, bottom))

    def _places(
        self,
        image: Image,
        view: EyeView,
        expected: Pixel,
        reach_px: int,
        size: tuple[int, int],
        most: int,
        prior: float,
        own: MaskAt | None = None,
    ) -> tuple[list[tuple[Pixel, float]], float]:
        """Return up to `most` places of the template of a size, the best first, with their correlation.

        The second value is how far from the best one the surface is as high [px].
        """
        scale, reach = size[1], -(-reach_px // size[1])
        template = self._template(image, view, expected, size, own)
        if cv2.meanStdDev(template.image)[1][0, 0] < _LEAST_CONTRAST:
            return [], float(reach_px)
        at = (round(expected[0]), round(expected[1]))
        left, top, right, bottom = (scale * (side + reach) for side in template.sides)
        area = cut(image, at[0] - left, at[1] - top, left + right + scale, top + bottom + scale)
        surface = _correlation(reduced(area, scale), template)
        evidence = _evidence(surface)
        ranked = evidence - _cost(surface.shape, prior)
        j, i = divmod(int(ranked.argmax()), ranked.shape[1])
        rows, columns = np.nonzero(evidence >= evidence[j, i] - _AS_ALIKE)
        spread_px = scale * float(np.hypot(rows - j, columns - i).max())
        middle_px = 0.5 * (scale - 1) - scale * reach
        places: list[tuple[Pixel, float]] = []
        apart = max(int(_APART_PX) // scale, 1)
        for _ in range(most):
            j, i = divmod(int(ranked.argmax()), ranked.shape[1])
            if ranked[j, i] <= _TAKEN or surface[j, i] <= 0.0:
                break
            di, dj = peak_offset(ranked, i, j)
            place = (at[0] + scale * (i + di) + middle_px, at[1] + scale * (j + dj) + middle_px)
            places.append((place, float(surface[j, i])))
            ranked[max(j - apart, 0) : j + apart + 1, max(i - apart, 0) : i + apart + 1] = _TAKEN
        return places, spread_px


def _reaches(image: Image, pixel: Pixel) -> tuple[float, float, float, float]:
    """Return how far an image reaches to the left, top, right and bottom of a pixel."""
    height, width = image.shape
    return pixel[0], pixel[1], width - 1 - pixel[0], height - 1 - pixel[1]


def _is_displaced(at: Pixel, far: Pixel) -> bool:
    """Return whether what lies far behind a point has moved against it."""
    return distance(at, far) > _SAME_PX


def _turned(mask: Image, warp: NDArray[np.float64], shape: tuple[int, ...]) -> Image | None:
    """Return the part of a mask that a template (h, w) is of; None where too little of that counts."""
    flags = cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP
    turned = np.asarray(cv2.warpPerspective(mask, warp, shape[::-1], flags=flags))
    counts = turned >= _MOSTLY_OWN
    return np.where(counts, np.uint8(255), np.uint8(0)) if np.count_nonzero(counts) >= _LEAST_OWN_PX else None


@lru_cache(maxsize=32)
def _cost(shape: tuple[int, ...], prior: float) -> NDArray[np.float32]:
    """Return by how much each place of a search is worse for its distance from the middle: `prior` at the rim."""
    down, across = (np.linspace(-1.0, 1.0, n, dtype=np.float32) ** 2 if n > 1 else np.zeros(1) for n in shape)
    cost = np.asarray(np.float32(prior) * np.add.outer(down, across), np.float32)
    cost.flags.writeable = False
    return cost


def _best_near(image: Image, template: Template, place: Pixel, reach: int) -> tuple[Pixel, float, float]:
    """Return the sub-pixel place within reach where the template fits best, its correlation, and that at `place`.

    Of places that fit alike the nearest counts.
    """
    (left, top, _, _), (height, width) = template.sides, template.image.shape
    x0, y0 = round(place[0]) - left - reach, round(place[1]) - top - reach
    area = cut(image, x0, y0, width + 2 * reach, height + 2 * reach)
    surface = _correlation(area, template)
    nearest = _evidence(surface) - _cost(surface.shape, _POINT_PRIOR)
    j, i = divmod(int(nearest.argmax()), surface.shape[1])
    di, dj = peak_offset(nearest, i, j)
    return (x0 + left + i + di, y0 + top + j + dj), float(surface[j, i]), float(surface[reach, reach])


def _evidence(similarity: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return how much correlations say for their places: a place that leaves half as much unexplained has 0.7 more."""
    return np.asarray(-np.log(1.0 + _NOISE - similarity), np.float32)


def _correlation(area: Image, template: Template) -> NDArray[np.float32]:
    how = cv2.TM_CCOEFF_NORMED
    surface = np.asarray(cv2.matchTemplate(area, template.image, how, mask=template.mask), np.float32)
    if template.mask is not None:
        surface[~(np.abs(surface) <= _LARGEST_CORRELATION)] = -1.0  # or not finite
    return surface
