"""Appearance of the target in one eye: sparse optical flow from frame to frame, templates against drift."""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_metric.disparity.correlation import peak_offset
from vergence_metric.disparity.fovea_pair import cut
from vergence_metric.disparity.protocol import Image
from vergence_metric.tracking.eye_view import Pixel

_MIN_HALF_PX = 9
_MAX_HALF_PX = 32
_MAX_FEATURES = 40
_MIN_FEATURES = 6
_FLOW_MARGIN_PX = 40
_ROUND_TRIP_PX = 0.7
_OUTLIER_PX = 2.5
_REANCHOR_PX = 7
_REANCHOR_SHARE = 0.4
_GOOD_SIMILARITY = 0.85
_MIN_SIMILARITY_FOR_FEATURES = 0.7
_MAX_SCALE_STEP = 0.08


@dataclass(frozen=True)
class Sighting:
    """Position of the target [px], similarity to its appearance (correlation, -1..1), number of features followed.

    `spread_px` is how far from the position another looks as much like the target's surroundings.
    """

    pixel: Pixel
    similarity: float
    features: int
    spread_px: float = 0.0


class TargetAppearance:
    """Model of the target's appearance; pixels are (x, y) of the left image."""

    def __init__(self, image: Image, pixel: Pixel, extent_px: tuple[float, float]) -> None:
        """Learn the target at a pixel of an image; `extent_px` (width, height) bounds it."""
        self.extent_px = extent_px
        self.scale = 1.0
        self._half = tuple(round(min(max(e / 2, _MIN_HALF_PX), _MAX_HALF_PX)) for e in extent_px)
        self._first = self._patch(image, pixel)
        self._recent = self._first
        self._previous = image
        self.pixel = pixel
        self._carried, self._step = self._find_features(image), 1.0
        self._features: NDArray[np.float32] | None = self._carried  # None: to be found in the previous image

    def _patch(self, image: Image, pixel: Pixel) -> NDArray[np.float32]:
        """Return the patch about a pixel, resampled so that the pixel is at its very centre."""
        across, down = self._half
        return cv2.getRectSubPix(
            image.astype(np.float32) if image.dtype != np.uint8 else image,
            (2 * across + 1, 2 * down + 1),
            pixel,
            patchType=cv2.CV_32F,
        )

    def _find_features(self, image: Image) -> NDArray[np.float32]:
        half = [max(_MIN_HALF_PX, min(round(0.45 * e * self.scale), 60)) for e in self.extent_px]
        x0, y0 = round(self.pixel[0]) - half[0], round(self.pixel[1]) - half[1]
        area = cut(image, x0, y0, 2 * half[0] + 1, 2 * half[1] + 1)
        found = cv2.goodFeaturesToTrack(area, _MAX_FEATURES, 0.03, 4, blockSize=5)
        if found is None:
            return np.empty((0, 2), np.float32)
        return np.asarray(found, np.float32).reshape(-1, 2) + np.array([x0, y0], np.float32)

    def follow(self, image: Image, expected_px: Pixel) -> Sighting:
        """Return the target's position in the next image near `expected_px`; the state changes only by `accept`."""
        moved, carried, step = self._flow(image, expected_px)
        pixel = expected_px if moved is None else moved
        reach = _REANCHOR_PX if moved is not None else 3 * _REANCHOR_PX
        anchored, similarity = self._anchor(image, pixel, reach)
        if moved is None:
            pixel = anchored
        elif similarity > 0.5:
            share = _REANCHOR_SHARE
            pixel = tuple(m + share * (a - m) for m, a in zip(moved, anchored, strict=True))  # type: ignore[assignment]
        self._carried, self._step = carried, step
        return Sighting((float(pixel[0]), float(pixel[1])), similarity, len(carried))

    def search(self, image: Image, expected_px: Pixel, reach_px: int) -> Sighting:
        """Return the target's most similar position within reach of the expected one, by template alone."""
        self.drop_features()
        pixel, similarity = self._anchor(image, expected_px, reach_px)
        return Sighting(pixel, similarity, 0)

    def drop_features(self) -> None:
        """Forget the features that were followed: the target's next position does not come from them."""
        self._carried, self._step = np.empty((0, 2), np.float32), 1.0

    def accept(self, image: Image, sighting: Sighting, renew: bool) -> None:
        """Accept a sighting as the target's position; `renew` also updates the recent template."""
        self.pixel = sighting.pixel
        self.scale *= self._step
        too_few = len(self._carried) < _MAX_FEATURES // 2 and sighting.similarity > _MIN_SIMILARITY_FOR_FEATURES
        self._features = None if too_few else self._carried
        if renew and sighting.similarity > _GOOD_SIMILARITY:
            self._recent = self._patch(image, self.pixel)
        self._previous = image

    def _flow(self, image: Image, expected_px: Pixel) -> tuple[Pixel | None, NDArray[np.float32], float]:
        """Follow the features to the new image; return the target's position, the features, and the change of scale."""
        none = np.empty((0, 2), np.float32)
        # Only here: a target that its surroundings give is not followed by features.
        features = self._find_features(self._previous) if self._features is None else self._features
        if len(features) < _MIN_FEATURES:
            return None, none, 1.0
        reach = np.abs(features - np.array(self.pixel)).max(axis=0)
        half = np.ceil(reach).astype(int) + _FLOW_MARGIN_PX
        old = (round(self.pixel[0]) - int(half[0]), round(self.pixel[1]) - int(half[1]))
        new = (round(expected_px[0]) - int(half[0]), round(expected_px[1]) - int(half[1]))
        size = (2 * int(half[0]) + 1, 2 * int(half[1]) + 1)
        before, after = cut(self._previous, *old, *size), cut(image, *new, *size)
        start = (features - np.array(old, np.float32)).reshape(-1, 1, 2)
        options: dict[str, Any] = {"winSize": (13, 13), "maxLevel": 2, "criteria": (3, 15, 0.02)}
        there, found, _ = cv2.calcOpticalFlowPyrLK(before, after, start, None, **options)
        back, returned, _ = cv2.calcOpticalFlowPyrLK(after, before, there, None, **options)
        trip = np.linalg.norm((back - start).reshape(-1, 2), axis=1)
        good = (found.ravel() == 1) & (returned.ravel() == 1) & (trip < _ROUND_TRIP_PX)
        if int(good.sum()) < _MIN_FEATURES:
            return None, none, 1.0
        before_px = features[good]
        after_px = there.reshape(-1, 2)[good] + np.array(new, np.float32)
        shift = np.median(after_px - before_px, axis=0)
        agree = np.linalg.norm(after_px - before_px - shift, axis=1) < _OUTLIER_PX
        if int(agree.sum()) < max(_MIN_FEATURES, 0.5 * len(agree)):
            return None, none, 1.0
        before_px, after_px = before_px[agree], after_px[agree]
        step = _scale_step(before_px, after_px)
        offset = np.median(after_px - before_px - (step - 1.0) * (before_px - np.array(self.pixel)), axis=0)
        return (self.pixel[0] + float(offset[0]), self.pixel[1] + float(offset[1])), after_px, step

    def _anchor(self, image: Image, expected_px: Pixel, reach: int) -> tuple[Pixel, float]:
        """Return the position within reach most similar to the first or recent template, and the similarity."""
        best, similarity = expected_px, -1.0
        x0 = [round(e) - h - reach for e, h in zip(expected_px, self._half, strict=True)]
        area = cut(image, x0[0], x0[1], *(2 * (h + reach) + 1 for h in self._half)).astype(np.float32)
        for template in (self._recent, self._first):
            resized = template
            if template is self._first and abs(self.scale - 1.0) > 0.02:
                resized = _zoomed(template, self.scale)
            surface = cv2.matchTemplate(area, resized, cv2.TM_CCOEFF_NORMED)
            j, i = divmod(int(np.nan_to_num(surface, nan=-1.0).argmax()), surface.shape[1])
            if float(surface[j, i]) > similarity:
                similarity = float(surface[j, i])
                di, dj = peak_offset(surface, i, j)
                best = (x0[0] + self._half[0] + i + di, x0[1] + self._half[1] + j + dj)
            if template is self._recent and self._recent is self._first:
                break
        return best, similarity


def _scale_step(before: NDArray[np.float32], after: NDArray[np.float32]) -> float:
    """Return the change of the features' spread, robustly; 1 where they are too few to measure it."""
    if len(before) < 2 * _MIN_FEATURES:
        return 1.0
    old = np.linalg.norm(before - np.median(before, axis=0), axis=1)
    new = np.linalg.norm(after - np.median(after, axis=0), axis=1)
    far = old > 3.0
    if int(far.sum()) < _MIN_FEATURES:
        return 1.0
    ratio = float(np.median(new[far] / old[far]))
    return min(max(ratio, 1.0 - _MAX_SCALE_STEP), 1.0 + _MAX_SCALE_STEP)


def _zoomed(template: NDArray[np.float32], scale: float) -> NDArray[np.float32]:
    """Return the template seen `scale` times as large, cut to its own size."""
    h, w = template.shape
    matrix = np.array([[scale, 0, (1 - scale) * (w - 1) / 2], [0, scale, (1 - scale) * (h - 1) / 2]])
    return np.asarray(cv2.warpAffine(template, matrix, (w, h), flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))
