"""One object in one pair of images: its boxes, and what is measured of it alone."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vergence_metric.boxes.association import Association, BoxPair
from vergence_metric.boxes.detections import Box, covered_share
from vergence_metric.boxes.pair_geometry import PairGeometry
from vergence_metric.boxes.patch_descriptor import Descriptor, patch_descriptor
from vergence_metric.boxes.target_point import meeting
from vergence_rig.geometry import GeometryError

Array = NDArray[np.float64]

_OVERLAP_SHARE = 0.1
_BORDER_SHARE = 0.015  # of the image: a side so near its border may be a cut one


@dataclass(frozen=True)
class ObjectBoxes:
    """One object in one pair of images: its pair of boxes, or the box of the one eye that sees it."""

    left: Box | None = None
    right: Box | None = None
    pair: BoxPair | None = None

    @property
    def shown(self) -> Box:
        """The left box, or else the right one."""
        box = self.left or self.right
        assert box is not None
        return box

    @property
    def sure(self) -> tuple[Box | None, Box | None]:
        """Both eyes' boxes, without the right one of an ambiguous pair: a guess must not decide the next pair."""
        ambiguous = self.pair is not None and self.pair.ambiguous
        return self.left, (None if ambiguous else self.right)

    @property
    def score(self) -> float:
        """The score of the eye that is surer."""
        return max(box.score for box in (self.left, self.right) if box is not None)


@dataclass(frozen=True)
class SeenObject:
    """An object in view: its id, its boxes, and where it is; NaN where that cannot be known from this pair.

    `version_rad` and `tilt_rad` look at it. `distance_m`, from the cyclopean eye, and `size_px`, the square root of its
    box's width times height, are averaged over the last pairs, and known while one eye alone sees it too.
    """

    object_id: int
    boxes: ObjectBoxes
    version_rad: float
    tilt_rad: float
    distance_m: float
    size_px: float

    @property
    def class_name(self) -> str:
        """The class of its boxes."""
        return self.boxes.shown.class_name


@dataclass(frozen=True)
class ObjectMeasures:
    """What is measured of an object in one pair; NaN or None where it cannot be.

    `hidden` says that another object's box overlaps its own: its looks may be the other one's.
    """

    boxes: ObjectBoxes
    point_m: Array | None
    parallax_rad: float
    log_size: float
    looks: Descriptor | None
    hidden: bool


def objects_of(found: Association) -> list[ObjectBoxes]:
    """Return the objects of a pair of images: pairs of boxes first, then boxes of one eye."""
    pairs = [ObjectBoxes(pair.left, pair.right, pair) for pair in found.pairs]
    return [
        *pairs,
        *(ObjectBoxes(left=box) for box in found.left_only),
        *(ObjectBoxes(None, b) for b in found.right_only),
    ]


def measured(
    boxes: ObjectBoxes,
    others: Sequence[ObjectBoxes],
    images: tuple[NDArray[Any], NDArray[Any]] | None,
    geometry: PairGeometry | None,
) -> ObjectMeasures:
    """Return what is measured of an object by its boxes; without images not its looks. `others` are all boxes."""
    left, right = boxes.sure
    shown = boxes.shown
    point, parallax = None, math.nan
    if geometry is not None and left is not None and right is not None:
        parallax = geometry.parallax_rad(left.point_px, right.point_px)
        cameras = geometry.left, geometry.right
        try:
            point = meeting(left.point_px, right.point_px, cameras, geometry.eyes, geometry.kinematics)
        except GeometryError:
            point = None
    image = None if images is None else images[0 if left is not None else 1]
    beside = (other.left if left is not None else other.right for other in others if other is not boxes)
    # A cut box shows neither the object's size nor all of its looks.
    whole = not shown.is_cut and (image is None or _is_inside(shown, image))
    width, height = shown.size_px
    return ObjectMeasures(
        boxes,
        point,
        parallax,
        0.5 * math.log(max(width * height, 1.0)) if whole else math.nan,
        patch_descriptor(image, shown) if whole and image is not None else None,
        any(covered_share(shown, other) > _OVERLAP_SHARE for other in beside if other is not None),
    )


def _is_inside(box: Box, image: NDArray[Any]) -> bool:
    """Return whether a box is well inside its image."""
    height, width = image.shape[:2]
    x_min, y_min, x_max, y_max = box.xyxy_px
    across, down = _BORDER_SHARE * width, _BORDER_SHARE * height
    return min(x_min, width - x_max) > across and min(y_min, height - y_max) > down
