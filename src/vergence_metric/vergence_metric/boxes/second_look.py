"""A second look: the same network on a crop of the full image about each box, for finer sides and a better score.

In the first run the image is shrunk to the network's input, and a small object is a few pixels there. In the second run
the input shows the object alone, larger.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_metric.boxes.layouts import Candidates
from vergence_metric.boxes.letterbox import BORDER_GREY

MOST_LOOKS = 4
"""Boxes of an image that get a second look, the best ones; the others stay as they are."""

CROP_PX = (96, 96)
"""Of the crop as the network sees it (width, height): whole strides, an eighth of the usual input."""

_CROP_SHARE = 1.5  # of the box's sides
_LARGEST_ZOOM = 3.3  # a larger one shows nothing finer
_ANTIALIAS = 0.45
_SAME_OBJECT_IOU = 0.4  # of the boxes of both looks


@dataclass(frozen=True)
class Window:
    """Where a crop lies: its outer corner in the image [px], image pixels per pixel of the crop, (width, height)."""

    x: float
    y: float
    scale: float
    size_px: tuple[int, int]

    @classmethod
    def about(
        cls, xyxy: NDArray[np.float64], image_px: tuple[int, int], size_px: tuple[int, int] = CROP_PX
    ) -> "Window":
        """Return the window about a box (4,) in raw pixels of an image of (width, height)."""
        size = xyxy[2:] - xyxy[:2]
        scale = max(float((_CROP_SHARE * size / size_px).max()), 1.0 / _LARGEST_ZOOM)
        covered = scale * np.array(size_px)
        room = np.array(image_px) - covered
        corner = 0.5 * (xyxy[:2] + xyxy[2:]) + 0.5 - 0.5 * covered
        # Within the image, as far as that is possible: pixels beyond it hold no information.
        corner = np.where(room >= 0, np.clip(corner, 0, np.maximum(room, 0)), 0.5 * room)
        return cls(float(corner[0]), float(corner[1]), scale, size_px)

    def of(self, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return the crop (height, width, 3) of an image; what lies beyond it is grey."""
        s = self.scale
        height, width = image.shape[:2]
        low_x, low_y = max(int(self.x) - 4, 0), max(int(self.y) - 4, 0)
        high_x, high_y = (
            int(corner + s * side) + 5 for corner, side in zip((self.x, self.y), self.size_px, strict=True)
        )
        part = image[low_y : min(high_y, height), low_x : min(high_x, width)]
        if s > 1.3:
            part = np.asarray(cv2.GaussianBlur(part, (0, 0), _ANTIALIAS * s))
        matrix = np.array(
            [[s, 0.0, self.x - low_x + 0.5 * s - 0.5], [0.0, s, self.y - low_y + 0.5 * s - 0.5]], np.float64
        )
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        return np.asarray(
            cv2.warpAffine(
                part,
                matrix,
                self.size_px,
                flags=flags,
                borderMode=cv2.BORDER_CONSTANT,
                borderValue=(BORDER_GREY, BORDER_GREY, BORDER_GREY),
            ),
            np.uint8,
        )

    def to_image(self, corners: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return boxes (N, 4) or points (N, 2) in raw image pixels."""
        return corners * self.scale + np.tile([self.x, self.y], corners.shape[-1] // 2) - 0.5


def look_again(
    image: NDArray[np.uint8],
    seen: Candidates,
    first_scale: float,
    detect: Callable[[list[NDArray[np.uint8]]], Sequence[Candidates]],
) -> Candidates:
    """Return the candidates after a second look at the best ones.

    A box's score becomes the mean over both looks; a second look that does not find it with its class counts as 0. Its
    sides and landmarks become their mean, weighted as if each look erred by the same share of its own pixels.

    Args:
        image: (h, w, 3) BGR.
        seen: boxes and landmarks in its pixels, best first.
        first_scale: image pixels per pixel of the first look.
        detect: returns for each of several pictures of CROP_PX all candidates, down to low scores.

    """
    boxes, means = seen.xyxy.copy(), seen.scores.copy()
    landmarks = None if seen.landmarks is None else seen.landmarks.copy()
    windows = [Window.about(box, (image.shape[1], image.shape[0])) for box in seen.xyxy[:MOST_LOOKS]]
    found = detect([window.of(image) for window in windows]) if windows else []
    for i, (window, candidates) in enumerate(zip(windows, found, strict=True)):
        again = window.to_image(candidates.xyxy)
        same = (_overlaps(again, seen.xyxy[i]) >= _SAME_OBJECT_IOU) & (candidates.class_ids == seen.class_ids[i])
        means[i] = 0.5 * seen.scores[i]
        if same.any():
            best = int(np.flatnonzero(same)[candidates.scores[same].argmax()])
            means[i] += 0.5 * float(candidates.scores[best])
            share = first_scale**2 / (first_scale**2 + window.scale**2)
            boxes[i] = (1.0 - share) * seen.xyxy[i] + share * again[best]
            if landmarks is not None and candidates.landmarks is not None:
                points = window.to_image(candidates.landmarks[best])
                landmarks[i] = (1.0 - share) * landmarks[i] + share * points
    return Candidates(boxes, means, seen.class_ids, landmarks)


def _overlaps(boxes: NDArray[np.float64], box: NDArray[np.float64]) -> NDArray[Any]:
    low, high = np.maximum(boxes[:, :2], box[:2]), np.minimum(boxes[:, 2:], box[2:])
    shared = np.clip(high - low, 0, None).prod(1)
    areas = (boxes[:, 2:] - boxes[:, :2]).prod(1) + (box[2:] - box[:2]).prod()
    return np.asarray(shared / np.maximum(areas - shared, 1e-9))
