"""The protocol of disparity estimators: `estimate` of a pair of images at a point returns a `Disparity`."""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]
Point = tuple[float, float]


class DisparityInputError(ValueError):
    """Images or a point that no estimator can work on."""


class DisparityStatus(IntEnum):
    """Whether the disparity could be measured, or why not; the numbers are those of VergenceError.msg."""

    OK = 0
    NO_TEXTURE = 1
    AMBIGUOUS = 2
    NO_MATCH = 3
    OUT_OF_RANGE = 4


@dataclass(frozen=True)
class Candidate:
    """A disparity [px] that a point may have, its likelihood (0 to 1) and where it was found."""

    disparity_px: float
    likelihood: float
    found_by: str


@dataclass(frozen=True)
class Surface:
    """The surface that a point lies on: how its disparities change about the point, and which pixels belong to it.

    `slopes` (2, 2) are the changes of the horizontal and of the vertical disparity (rows) per pixel across and down.
    `support` (h, w) is 1 at pixels on the surface, else 0; its top left pixel is `origin_px` (x, y) of the left image.
    """

    slopes: NDArray[np.float64]
    support: NDArray[np.float32]
    origin_px: tuple[int, int]

    def share(self, point_px: Point, half_px: int) -> float:
        """Return the share of the pixels in the square about a point that lie on the surface; 0 outside the support."""
        i, j = round(point_px[0]) - self.origin_px[0] - half_px, round(point_px[1]) - self.origin_px[1] - half_px
        side = 2 * half_px + 1
        about = self.support[max(j, 0) : max(j + side, 0), max(i, 0) : max(i + side, 0)]
        return float(about.sum()) / side**2


@dataclass(frozen=True)
class Disparity:
    """The disparity of one point of the left image.

    `horizontal_px` is x_left - x_right, `vertical_px` is y_left - y_right of the world point seen at `point_px` (x, y)
    of the left image; positive horizontal means nearer than where the axes cross. `sigma_px` is the standard deviation
    of the horizontal one by image noise and texture; that of `affine` also by what its model misses, that of
    `semi_global` as fitted to real pairs. `confidence` is the share of estimates with the same evidence that lie within
    2 px of the truth (see `evidence.py`, `semi_global_model.py`). Where `status` is not OK the figures are NaN, except
    that an estimate that was measured and rejected keeps its best guess; its confidence is at most 0.5. `candidates`
    are the disparities that the point may have, likeliest first, where the estimator ranks them. `surface` is what the
    point lies on, where the estimator measures it.
    """

    horizontal_px: float
    vertical_px: float
    sigma_px: float
    confidence: float
    status: DisparityStatus
    reason: str
    estimator: str
    point_px: Point
    candidates: tuple[Candidate, ...] = ()
    surface: Surface | None = field(default=None, repr=False, compare=False)

    @property
    def ok(self) -> bool:
        """True if the estimate may be used."""
        return self.status is DisparityStatus.OK

    @classmethod
    def none(cls, status: DisparityStatus, reason: str, estimator: str, point_px: Point) -> "Disparity":
        """Return an estimate without a value, and why."""
        return cls(math.nan, math.nan, math.nan, 0.0, status, reason, estimator, point_px)


class DisparityEstimator(ABC):
    """Estimates the disparity at a point of the left image, by whatever search.

    Subclasses implement `estimate_at`. `name` is what the parameter `disparity.estimator` selects it by, and what it
    reports as `Disparity.estimator`. `register_estimator` adds it; it is then built with the DisparityParameters.
    """

    name: str

    def estimate(
        self, left: Image, right: Image, point_px: Point | None = None, expected_px: float | None = None
    ) -> Disparity:
        """Return the disparity at a point of the left image.

        Args:
            left: (h, w) grey image of the left eye.
            right: (h, w) grey image of the right eye, of the same size, rows roughly aligned.
            point_px: (x, y) in the left image; None for its centre ((w - 1)/2, (h - 1)/2).
            expected_px: approximate horizontal disparity, None if unknown. An estimator may search there first and stop
                if that match is confident.

        Raises:
            DisparityInputError: images that are not grey uint8 of one size, or a point outside them.

        """
        return self.estimate_at(left, right, _checked_point(left, right, point_px), expected_px)

    @abstractmethod
    def estimate_at(self, left: Image, right: Image, point_px: Point, expected_px: float | None) -> Disparity:
        """Return the disparity at a point, for images and a point that are already checked; see `estimate`."""


def _checked_point(left: Image, right: Image, point_px: Point | None) -> Point:
    """Return the point asked for, the centre if None; raise DisparityInputError for input that cannot be."""
    for name, image in (("left", left), ("right", right)):
        if image.ndim != 2 or image.dtype != np.uint8 or image.size == 0:
            raise DisparityInputError(f"{name} image must be uint8 (h, w), not empty: got {image.dtype} {image.shape}")
    if left.shape != right.shape:
        raise DisparityInputError(f"right image must be of the left one's size {left.shape}: got {right.shape}")
    height, width = left.shape
    if point_px is None:
        return (width - 1) / 2, (height - 1) / 2
    x, y = float(point_px[0]), float(point_px[1])
    if not (0.0 <= x <= width - 1 and 0.0 <= y <= height - 1):
        raise DisparityInputError(f"point must be inside the {width}x{height} image: got ({x:g}, {y:g})")
    return x, y
