"""The appearance of a point in the image in which it was asked for, found again after the eye has turned.

Turning a camera about its optical centre warps its image by a homography that the joint angles give, whatever the
depth. What was seen is therefore warped to how it must look now, and only its place is searched, coarse to fine: the
reported angles of hobby servos are off by up to degrees. The wide view says where the eye has turned to, the context
where the point is (beside the wide view's place if it is near and the lens is off its axis), the point itself the rest.
Along an edge or without texture, where a level looks the same everywhere, the place of the level before is kept.
Of an eye at rest the context is looked at where it is expected first: if it is there, that is enough.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_metric.disparity.correlation import peak_offset
from vergence_metric.disparity.fovea_pair import cut
from vergence_metric.disparity.protocol import Image
from vergence_metric.tracking.eye_view import EyeView, Pixel, distance
from vergence_metric.tracking.patch_search import Template, best_near, correlation, distance_cost, evidence_of
from vergence_metric.tracking.reduced import levelled, reduced
from vergence_metric.tracking.surroundings import WIDE_HALF_PX, WIDE_SCALE

_WIDE_SIMILARITY = 0.7  # from which the wide view's place is where the context is looked for
_WIDE_REACH_PX = 16  # that parallax may move the point beside it
_OWN_REACH_PX = 8  # the same where the head's geometry says how far it does: the point's own pixels may be few
_CLOSE_PX, _CLEAR_SPREAD_PX = 4, 3.0  # of an eye at rest: where its context alone is sought, and must be at one place
_CONTEXT_HALF_PX, _CONTEXT_SCALE = 48, 2  # on photographs the smallest that rarely errs
_POINT_HALF_PX, _NARROW_HALF_PX = 16, 6  # the latter where its background has moved, and may fill most of the former
NEVER = -1.0
"""No correlation is below it."""
_ALONE_LEAD = 0.3  # in correlation, over any other place: without its surroundings a point must be unmistakable
_CANDIDATES = 3
_APART_PX = 12.0  # two peaks of the context closer than this are one place
_REFINED_WITHIN_PX = 4
_LEAST_CONTRAST = 1.0  # standard deviation of a template [grey levels]
_AS_ALIKE = 0.2  # difference in evidence below which two places look alike
_PRIOR, _WIDE_PRIOR = 0.3, 4.0  # evidence by which a place at the rim of its search is worse
_SAME_PX = 2.0  # by which what is in front of or behind a surface may have moved against it, and still count
_MOSTLY_OWN = 128  # of 255
_LEAST_OWN_PX = 60
_TAKEN = -99.0  # evidence where a place has been found already

MaskAt = Callable[[int], "Image | None"]
"""The mask (h, w) of a point's own surface at a scale; None where it is not known."""


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
    """What surrounds a pixel of one eye's image, (h, w) uint8, with the eye's view at that moment.

    `surroundings_m` is how far away most of it is, None where that is not known yet.
    """

    def __init__(self, image: Image, view: EyeView, pixel: Pixel, surroundings_m: float | None = None) -> None:
        self._view, self.surroundings_m = view, surroundings_m
        self.direction = view.direction(pixel)
        self._place = np.array(view.pixel(self.direction))
        self._levels = {scale: reduced(image, scale) for scale in (1, _CONTEXT_SCALE, WIDE_SCALE)}
        self._levelled = {scale: levelled(level, scale) for scale, level in self._levels.items()}
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

        Where its surroundings, or what lies there at the point, are less similar than `alone_below`, the point itself
        counts if it is unmistakable.
        `distance_m` is the point's: a lens off its axis has moved, and what is farther away lies beside the point now.
        Then only its own surface counts, as `own` returns its mask at a scale.
        """
        expected, height, width = view.pixel(direction), *image.shape
        if not (-reach_px <= expected[0] < width + reach_px and -reach_px <= expected[1] < height + reach_px):
            return None
        far = self._far(view, direction, distance_m)
        displaced = _is_displaced(expected, far)
        own, half_px = _counting(displaced, own)
        size, reach, prior = (_CONTEXT_HALF_PX, _CONTEXT_SCALE), reach_px, _PRIOR
        places, spread_px = list[tuple[Pixel, float]](), math.inf
        if reach <= _CLOSE_PX and not displaced:
            places, spread_px = self._places(image, view, expected, reach, size, 1, prior, own)
        if not _is_clear(places, spread_px, expected, reach):
            expected, reach, prior, wide_spread_px = self._about(image, view, expected, far, reach_px)
            places, spread_px = self._places(image, view, expected, reach, size, _CANDIDATES, prior, own)
            spread_px = min(spread_px, wide_spread_px)
        if not places:
            return None
        template = self._template(image, view, expected, (half_px, 1), own)
        found = []
        for place, similarity in places:
            pixel, at_point, _ = best_near(image, template, place, _REFINED_WITHIN_PX)
            off = math.hypot(place[0] - expected[0], place[1] - expected[1]) / reach
            evidence = float(evidence_of(np.array([similarity, at_point], np.float32)).sum())
            found.append((evidence - prior * off**2, similarity, at_point, pixel))
        _, similarity, at_point, pixel = max(found)
        sighting = PatchSighting(pixel, similarity, at_point, spread_px)
        if min(similarity, at_point) >= alone_below:
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

        The wide view is expected at `far`: most of it is at another distance than the point.
        """
        reach = max(reach_px, _WIDE_REACH_PX)
        prior = _PRIOR * (reach / max(reach_px, 1)) ** 2
        wide, spread_px = self._places(image, view, far, reach, (WIDE_HALF_PX, WIDE_SCALE), 1, prior)
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
        own, half_px = _counting(_is_displaced(pixel, far), own)
        template = self._template(image, view, pixel, (half_px, 1), own)
        place, similarity, here = best_near(image, template, pixel, reach_px)
        return PatchSighting(place, similarity, similarity), here

    def _far(self, view: EyeView, direction: NDArray[np.float64], distance_m: float) -> Pixel:
        """Return where that is now of the surroundings which was behind the point when the point was seen."""
        seen = self._view.direction_of(direction, view, distance_m)
        distance_m = math.inf if self.surroundings_m is None else self.surroundings_m
        return view.pixel(view.direction_of(seen, self._view, distance_m))

    def _template(self, image: Image, view: EyeView, at: Pixel, size: tuple[int, int], own: MaskAt | None) -> Template:
        """Return what must be seen about a pixel now, as far as both images reach, at a size (half side [px], scale).

        With `own` only the point's own surface counts, and images are not levelled by what lies beside it.
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
            (self._levelled if own is None else self._levels)[scale],
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
        there = reduced(area, scale)
        surface = correlation(levelled(there, scale) if own is None else there, template)
        evidence = evidence_of(surface)
        ranked = evidence - distance_cost(surface.shape, prior, scale)
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


def _is_clear(places: list[tuple[Pixel, float]], spread_px: float, expected: Pixel, reach_px: int) -> bool:
    """Return whether the best of a search's places is alike, alone, and not at the rim: nothing else need be looked at.

    A place at the rim may be on the way to a better one; along an edge its neighbours look the same.
    """
    if not places or places[0][1] < _WIDE_SIMILARITY or spread_px > _CLEAR_SPREAD_PX:
        return False
    (x, y), _ = places[0]
    return max(abs(x - expected[0]), abs(y - expected[1])) < reach_px - 1


def _counting(displaced: bool, own: MaskAt | None) -> tuple[MaskAt | None, int]:
    """Return the mask of what counts and how far about the point [px]; None: all, unless its background has moved."""
    if not displaced:
        return None, _POINT_HALF_PX
    known = own is not None and own(1) is not None
    return own, _POINT_HALF_PX if known else _NARROW_HALF_PX


def _turned(mask: Image, warp: NDArray[np.float64], shape: tuple[int, ...]) -> Image | None:
    """Return the part of a mask that a template (h, w) is of; None where too little of that counts."""
    flags = cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP
    turned = np.asarray(cv2.warpPerspective(mask, warp, shape[::-1], flags=flags))
    counts = turned >= _MOSTLY_OWN
    return np.where(counts, np.uint8(255), np.uint8(0)) if np.count_nonzero(counts) >= _LEAST_OWN_PX else None
