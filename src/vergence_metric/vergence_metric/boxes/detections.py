"""The objects that a detector found in one image."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_BORDER_PX = 1.5

FACE_LANDMARKS = ("right eye", "left eye", "nose tip", "right corner of the mouth", "left corner of the mouth")
"""The landmarks of a face in order, right and left as the person has them."""

Pixel = tuple[float, float]


@dataclass(frozen=True)
class Box:
    """One object's box in raw image pixels: origin at the centre of the top-left pixel, x right, y down.

    `xyxy_px` are the box's outer sides, so that a box of one pixel is one wide. `cut` is True for those of
    (left, top, right, bottom) that touch the image's border: they are not sides of the object. `landmarks_px` are those
    of a face (FACE_LANDMARKS), empty where the detector gives none.
    """

    xyxy_px: tuple[float, float, float, float]
    score: float
    class_id: int
    class_name: str
    cut: tuple[bool, bool, bool, bool] = (False, False, False, False)
    landmarks_px: tuple[Pixel, ...] = ()

    @property
    def point_px(self) -> Pixel:
        """The point (x, y) of the object to look at: between the eyes of a face with landmarks, else the centre."""
        if not self.landmarks_px:
            return self.center_px
        (right_x, right_y), (left_x, left_y) = self.landmarks_px[:2]
        return 0.5 * (right_x + left_x), 0.5 * (right_y + left_y)

    @property
    def center_px(self) -> tuple[float, float]:
        """The box's centre (x, y)."""
        x_min, y_min, x_max, y_max = self.xyxy_px
        return 0.5 * (x_min + x_max), 0.5 * (y_min + y_max)

    @property
    def size_px(self) -> tuple[float, float]:
        """Width and height."""
        x_min, y_min, x_max, y_max = self.xyxy_px
        return x_max - x_min, y_max - y_min

    @property
    def is_cut(self) -> bool:
        """True if any side touches the image's border."""
        return any(self.cut)


@dataclass(frozen=True)
class Detections:
    """Every object of one image, best score first: `xyxy_px` (N, 4), `scores` (N,), `class_ids` (N,).

    `landmarks_px` (N, L, 2) are points on the objects, None where the detector gives none.
    """

    xyxy_px: NDArray[np.float64]
    scores: NDArray[np.float64]
    class_ids: NDArray[np.int64]
    class_names: tuple[str, ...]
    image_size_px: tuple[int, int]
    landmarks_px: NDArray[np.float64] | None = None

    def __len__(self) -> int:
        return len(self.scores)

    def __iter__(self) -> Iterator[Box]:
        return iter(self.boxes())

    def boxes(self) -> list[Box]:
        """Return each object on its own."""
        cuts = cut_sides(self.xyxy_px, self.image_size_px)
        landmarks = np.empty((len(self), 0, 2)) if self.landmarks_px is None else self.landmarks_px
        return [
            Box(
                (float(box[0]), float(box[1]), float(box[2]), float(box[3])),
                float(score),
                int(class_id),
                name,
                (bool(cut[0]), bool(cut[1]), bool(cut[2]), bool(cut[3])),
                tuple((float(x), float(y)) for x, y in points),
            )
            for box, score, class_id, name, cut, points in zip(
                self.xyxy_px, self.scores, self.class_ids, self.class_names, cuts, landmarks, strict=True
            )
        ]


def make_detections(
    xyxy_px: NDArray[np.float64],
    scores: NDArray[np.float64],
    class_ids: NDArray[np.int64],
    names: Sequence[str],
    image_size_px: tuple[int, int],
    landmarks_px: NDArray[np.float64] | None = None,
) -> Detections:
    """Sort by score, clip to the image (width, height) and name the classes; a class without a name is its number."""
    width, height = image_size_px
    order = np.argsort(-scores, kind="stable")
    # The outermost pixels reach half a pixel beyond their centres.
    clipped = np.clip(xyxy_px[order], -0.5, [width - 0.5, height - 0.5, width - 0.5, height - 0.5])
    ids = class_ids[order]
    labels = tuple(names[i] if 0 <= i < len(names) else str(int(i)) for i in ids)
    landmarks = None if landmarks_px is None else landmarks_px[order]
    return Detections(clipped.reshape(-1, 4), scores[order], ids, labels, image_size_px, landmarks)


def cut_sides(xyxy_px: NDArray[np.float64], image_size_px: tuple[int, int]) -> NDArray[np.bool_]:
    """Return (N, 4), which sides (left, top, right, bottom) of boxes (N, 4) lie at the image's border."""
    width, height = image_size_px
    low, high = -0.5 + _BORDER_PX, (width - 0.5 - _BORDER_PX, height - 0.5 - _BORDER_PX)
    return np.column_stack(
        [xyxy_px[:, 0] <= low, xyxy_px[:, 1] <= low, xyxy_px[:, 2] >= high[0], xyxy_px[:, 3] >= high[1]]
    )


def covered_share(one: Box, other: Box) -> float:
    """Return the share of a box that another one covers."""
    a, b = one.xyxy_px, other.xyxy_px
    width, height = min(a[2], b[2]) - max(a[0], b[0]), min(a[3], b[3]) - max(a[1], b[1])
    return max(width, 0.0) * max(height, 0.0) / max(one.size_px[0] * one.size_px[1], 1e-9)
