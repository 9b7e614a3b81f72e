"""The appearance of a point in the image in which it was asked for, found again after the eye has turned.

Turning a camera about its optical centre warps its image by a homography that the joint angles give, whatever the
depth. The patch is therefore warped to how it must look now, and only its place is searched: the reported
angles of hobby servos are off by up to degrees.
"""

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_metric.disparity.correlation import peak_offset
from vergence_metric.disparity.fovea_pair import cut
from vergence_metric.disparity.protocol import Image
from vergence_metric.tracking.eye_view import EyeView, Pixel

_CONTEXT_HALF_PX = 48  # what lies around the point says where it is; on photographs the smallest that rarely errs
_POINT_HALF_PX = 16  # what lies at the point itself says exactly where
_CONTEXT_SCALE = 2  # the context is searched at half resolution
_CANDIDATES = 3
_APART_PX = 12.0  # two peaks of the context closer than this are one place
_REFINED_WITHIN_PX = 4
_LEVER_PX = 16.0
_LEAST_CONTRAST = 1.0  # standard deviation of the template [grey levels]
_PRIOR = 0.05  # similarity that a place at the rim of the search must be better by


@dataclass(frozen=True)
class PatchSighting:
    """Where the point is in the image now.

    `similarity` is the correlation of the point's surroundings with the remembered ones (-1 to 1).
    """

    pixel: Pixel
    similarity: float


class RememberedPatch:
    """What surrounds a pixel of one eye's image, (h, w) uint8, with the eye's view at that moment."""

    def __init__(self, image: Image, view: EyeView, pixel: Pixel) -> None:
        self._view = view
        self.direction = view.direction(pixel)
        reach = round(1.6 * _CONTEXT_HALF_PX)
        x0, y0 = round(pixel[0]) - reach, round(pixel[1]) - reach
        self._crop = cut(image, x0, y0, 2 * reach + 1, 2 * reach + 1)
        self._origin = np.array([x0, y0], dtype=np.float64)
        height, width = image.shape
        # (left, top, right, bottom): how far the image reaches about the pixel
        self._reaches = (pixel[0], pixel[1], width - 1 - pixel[0], height - 1 - pixel[1])

    def find(self, image: Image, view: EyeView, direction: NDArray[np.float64], reach_px: int) -> PatchSighting | None:
        """Return where it is, looked for within `reach_px` of `direction` (3,) in rig_base; None outside the image."""
        expected = view.pixel(direction)
        height, width = image.shape
        if not (-reach_px <= expected[0] < width + reach_px and -reach_px <= expected[1] < height + reach_px):
            return None
        then_from_now = self._mapping(view, direction)
        middle = (round(expected[0]), round(expected[1]))
        places = self._context_peaks(image, middle, then_from_now, reach_px)
        if not places:
            return None
        template = self._warped(then_from_now, _POINT_HALF_PX)
        sides = self._sides(_POINT_HALF_PX, 1)
        found = []
        for place, similarity in places:
            pixel, at_point, _ = _best_near(image, _part(template, sides), sides, place, _REFINED_WITHIN_PX)
            off = math.hypot(pixel[0] - expected[0], pixel[1] - expected[1]) / max(reach_px, 1)
            found.append((similarity + at_point - _PRIOR * off**2, similarity, pixel))
        _, similarity, pixel = max(found)
        return PatchSighting(pixel, similarity)

    def refine(self, image: Image, view: EyeView, pixel: Pixel, reach_px: int) -> tuple[PatchSighting, float]:
        """Return where the point itself is within `reach_px` of a pixel, and its similarity at that pixel.

        Only its nearest surroundings count: those of a moving object change.
        """
        template = self._warped(self._mapping(view, view.direction(pixel)), _POINT_HALF_PX)
        sides = self._sides(_POINT_HALF_PX, 1)
        place, similarity, here = _best_near(image, _part(template, sides), sides, pixel, reach_px)
        return PatchSighting(place, similarity), here

    def _mapping(self, view: EyeView, direction: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the affine map (2, 3) from offsets about the expected pixel now to pixels of the remembered crop."""
        x, y = view.pixel(direction)
        levers = [(_LEVER_PX, 0.0), (-_LEVER_PX, 0.0), (0.0, _LEVER_PX), (0.0, -_LEVER_PX)]
        right, left, down, up = (np.array(self._view.pixel(view.direction((x + dx, y + dy)))) for dx, dy in levers)
        centre = np.array(self._view.pixel(self.direction)) - self._origin
        return np.column_stack([(right - left) / (2 * _LEVER_PX), (down - up) / (2 * _LEVER_PX), centre])

    def _warped(self, then_from_now: NDArray[np.float64], half_px: int, scale: int = 1) -> Image:
        """Return the patch as it must look now, (2 half_px + 1) square in pixels of `scale`."""
        linear = scale * then_from_now[:, :2]
        offset = then_from_now[:, 2] - linear @ [half_px, half_px]
        crop = cv2.GaussianBlur(self._crop, (0, 0), 0.4 * scale) if scale > 1 else self._crop
        size = (2 * half_px + 1, 2 * half_px + 1)
        return np.asarray(
            cv2.warpAffine(
                crop,
                np.column_stack([linear, offset]),
                size,
                flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
                borderMode=cv2.BORDER_REPLICATE,
            )
        )

    def _sides(self, half_px: int, scale: int) -> tuple[int, int, int, int]:
        """Return how far the template reaches to the left, top, right and bottom: not beyond the remembered image."""
        left, top, right, bottom = (min(max(int(reach / scale) - 1, 3), half_px) for reach in self._reaches)
        return left, top, right, bottom

    def _context_peaks(
        self, image: Image, middle: tuple[int, int], then_from_now: NDArray[np.float64], reach_px: int
    ) -> list[tuple[Pixel, float]]:
        """Return the best places of the context, in pixels of the image, with their correlation."""
        scale, half = _CONTEXT_SCALE, _CONTEXT_HALF_PX // _CONTEXT_SCALE
        reach = -(-reach_px // scale)
        left, top, right, bottom = sides = self._sides(half, scale)
        template = _part(self._warped(then_from_now, half, scale), sides)
        if float(template.std()) < _LEAST_CONTRAST:
            return []
        width, height = left + right + 1 + 2 * reach, top + bottom + 1 + 2 * reach
        area = cut(
            image,
            middle[0] - scale * (left + reach),
            middle[1] - scale * (top + reach),
            scale * (width - 1) + 1,
            scale * (height - 1) + 1,
        )
        # Every second pixel of the smoothed area, so that the pixels of both scales have the same centres.
        small = np.ascontiguousarray(cv2.GaussianBlur(area, (0, 0), 0.4 * scale)[::scale, ::scale])
        surface = _correlation(small, template)
        places: list[tuple[Pixel, float]] = []
        apart = int(_APART_PX) // scale
        for _ in range(_CANDIDATES):
            j, i = divmod(int(surface.argmax()), surface.shape[1])
            value = float(surface[j, i])
            if value <= 0.0:
                break
            places.append(((middle[0] + scale * (i - reach), middle[1] + scale * (j - reach)), value))
            surface[max(j - apart, 0) : j + apart + 1, max(i - apart, 0) : i + apart + 1] = -1.0
        return places


def _part(template: Image, sides: tuple[int, int, int, int]) -> Image:
    """Return the part of a square template that reaches this far to the left, top, right and bottom of its middle."""
    half = template.shape[0] // 2
    left, top, right, bottom = sides
    return np.ascontiguousarray(template[half - top : half + bottom + 1, half - left : half + right + 1])


def _best_near(
    image: Image, template: Image, sides: tuple[int, int, int, int], place: Pixel, reach: int
) -> tuple[Pixel, float, float]:
    """Return the sub-pixel place within reach where the template fits best, its correlation, and that at `place`."""
    left, top, _, _ = sides
    x0, y0 = round(place[0]) - left - reach, round(place[1]) - top - reach
    area = cut(image, x0, y0, template.shape[1] + 2 * reach, template.shape[0] + 2 * reach)
    surface = _correlation(area, template)
    j, i = divmod(int(surface.argmax()), surface.shape[1])
    di, dj = peak_offset(surface, i, j)
    return (x0 + left + i + di, y0 + top + j + dj), float(surface[j, i]), float(surface[reach, reach])


def _correlation(area: Image, template: Image) -> NDArray[np.float32]:
    surface = cv2.matchTemplate(area, template, cv2.TM_CCOEFF_NORMED)
    return np.asarray(np.nan_to_num(surface, nan=-1.0, posinf=-1.0, neginf=-1.0), np.float32)
