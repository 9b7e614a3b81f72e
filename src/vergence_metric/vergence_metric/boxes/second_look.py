"""A second look: the same network on a crop of the full image about each box, for finer sides and a surer score."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_metric.boxes.decoding import Raw

MOST_LOOKS = 4
"""Boxes of an image that are looked at again; weaker ones stay as they are."""

CROP_PX = (128, 96)
"""Of the crop as the network sees it (width, height): whole strides, a sixth of the usual input."""

_CROP_SHARE = 1.7  # of the box's sides
_LARGEST_ZOOM = 3.3  # beyond, there is nothing finer to see
_ANTIALIAS = 0.45
_SAME = 0.4  # overlap of the two looks' boxes
_GREY = 114


@dataclass(frozen=True)
class _Window:
    """Where a crop lies: its outer corner in the image and image pixels per pixel of the crop."""

    x: float
    y: float
    scale: float

    @classmethod
    def about(cls, xyxy: NDArray[np.float64], image_px: tuple[int, int]) -> "_Window":
        size = xyxy[2:] - xyxy[:2]
        scale = max(float((_CROP_SHARE * size / CROP_PX).max()), 1.0 / _LARGEST_ZOOM)
        covered = scale * np.array(CROP_PX)
        room = np.array(image_px) - covered
        corner = 0.5 * (xyxy[:2] + xyxy[2:]) + 0.5 - 0.5 * covered
        # Within the image, as far as that is possible: what lies beyond it tells nothing.
        corner = np.where(room >= 0, np.clip(corner, 0, np.maximum(room, 0)), 0.5 * room)
        return cls(float(corner[0]), float(corner[1]), scale)

    def of(self, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        s = self.scale
        height, width = image.shape[:2]
        low_x, low_y = max(int(self.x) - 4, 0), max(int(self.y) - 4, 0)
        high_x, high_y = (int(corner + s * side) + 5 for corner, side in zip((self.x, self.y), CROP_PX, strict=True))
        part = image[low_y : min(high_y, height), low_x : min(high_x, width)]
        if s > 1.3:
            part = np.asarray(cv2.GaussianBlur(part, (0, 0), _ANTIALIAS * s))
        matrix = np.array(
            [[s, 0.0, self.x - low_x + 0.5 * s - 0.5], [0.0, s, self.y - low_y + 0.5 * s - 0.5]], np.float64
        )
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        return np.asarray(
            cv2.warpAffine(
                part, matrix, CROP_PX, flags=flags, borderMode=cv2.BORDER_CONSTANT, borderValue=(_GREY, _GREY, _GREY)
            ),
            np.uint8,
        )

    def to_image(self, xyxy: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return boxes (N, 4) in raw image pixels."""
        return xyxy * self.scale + np.array([self.x, self.y, self.x, self.y]) - 0.5


def look_again(
    image: NDArray[np.uint8],
    xyxy_px: NDArray[np.float64],
    scores: NDArray[np.float64],
    class_ids: NDArray[np.int64],
    see: Callable[[NDArray[np.uint8]], Raw],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return boxes (N, 4) and scores (N,) after a closer look at the best ones.

    The closer look is taken at the crop and at its mirror image: their errors have little in common. A box gets the
    mean of its sides over all looks that see it with its class; its score is the mean of the first look's and of both
    closer ones', of which one that does not see it gives 0.

    Args:
        image: (h, w, 3) BGR.
        xyxy_px: boxes in its pixels, best first.
        scores: theirs.
        class_ids: theirs.
        see: what the network finds in a picture of CROP_PX: all candidates, down to low scores.

    """
    boxes, sure = xyxy_px.copy(), scores.copy()
    for i in range(min(len(boxes), MOST_LOOKS)):
        window = _Window.about(xyxy_px[i], (image.shape[1], image.shape[0]))
        crop = window.of(image)
        looks = []
        for mirrored in (False, True):
            raw = see(np.ascontiguousarray(crop[:, ::-1]) if mirrored else crop)
            seen = window.to_image(_mirrored(raw.xyxy) if mirrored else raw.xyxy)
            same = (_overlaps(seen, xyxy_px[i]) >= _SAME) & (raw.class_ids == class_ids[i])
            if same.any():
                best = int(np.flatnonzero(same)[raw.scores[same].argmax()])
                looks.append((seen[best], float(raw.scores[best])))
        # What only one of the looks denies is in doubt, not gone.
        sure[i] = 0.5 * scores[i] + 0.25 * sum(score for _, score in looks)
        boxes[i] = np.mean([xyxy_px[i], *(seen for seen, _ in looks)], axis=0)
    return boxes, sure


def _mirrored(xyxy: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the crop's boxes (N, 4) with left and right exchanged."""
    return np.column_stack([CROP_PX[0] - xyxy[:, 2], xyxy[:, 1], CROP_PX[0] - xyxy[:, 0], xyxy[:, 3]])


def _overlaps(boxes: NDArray[np.float64], box: NDArray[np.float64]) -> NDArray[Any]:
    low, high = np.maximum(boxes[:, :2], box[:2]), np.minimum(boxes[:, 2:], box[2:])
    shared = np.clip(high - low, 0, None).prod(1)
    areas = (boxes[:, 2:] - boxes[:, :2]).prod(1) + (box[2:] - box[:2]).prod()
    return np.asarray(shared / np.maximum(areas - shared, 1e-9))
