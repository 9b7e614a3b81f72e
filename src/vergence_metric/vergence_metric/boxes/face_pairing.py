"""How well two faces, one of each eye, are one person's: by the shape that their landmarks make, its size, its depth.

The eyes of persons are about 63 mm apart, as far as the head's: a face's size and its disparity give the same distance.
"""

import math

import numpy as np
from numpy.typing import NDArray

from vergence_metric.boxes.detections import Box
from vergence_metric.boxes.pair_geometry import PairGeometry

_EYE_DISTANCE_M = 0.063
_EYE_DISTANCE_SIGMA = 0.17  # of its logarithm: of men, women and children, and a landmark's error
_JOINT_SIGMA_RAD = 0.006  # of the vergence, without feedback

# Standard deviations of a landmark, and of the size that all of a face have, between the two eyes.
_LANDMARK_SHARE = 0.04  # of the distance between the eyes: detection, and the other eye's view of a nose
_LANDMARK_FLOOR_PX = 0.7
_SIZE_SIGMA = 0.06
_KNEE = 2.0  # standard deviations up to which a deviation counts squared, beyond linearly
_SHAPE_WEIGHT = 2.0

Array = NDArray[np.float64]


def face_cost(a: Box, b: Box, geometry: PairGeometry | None) -> float:
    """Return the sum of squared deviations of two faces from one person's, of shape, size and depth.

    Args:
        a: a face of the left eye, with landmarks.
        b: a face of the right eye, with landmarks.
        geometry: of the pair; None leaves the depth out.

    """
    left, right = (np.array(box.landmarks_px) for box in (a, b))
    left, right = left - left.mean(0), right - right.mean(0)
    sizes = [math.sqrt(float((points**2).mean())) for points in (left, right)]
    if min(sizes) <= 0.0:
        return math.inf
    eyes_px = max(_eye_distance(a), _eye_distance(b), 1.0)
    sigma_px = math.hypot(_LANDMARK_FLOOR_PX, _LANDMARK_SHARE * eyes_px)
    between = math.sqrt(sizes[0] * sizes[1])
    # Landmarks of both at one size: the difference is shape.
    apart = (left / sizes[0] - right / sizes[1]) * between
    shape = float((apart**2).mean()) / (2.0 * sigma_px**2)
    size = math.log(sizes[0] / sizes[1]) / math.hypot(_SIZE_SIGMA, sigma_px / (2.0 * between))
    return _SHAPE_WEIGHT * shape + _huber(size) + (0.0 if geometry is None else _huber(_depth(a, b, geometry)))


def _eye_distance(box: Box) -> float:
    """Return the distance between the eyes as seen from the front [px]: of a turned face by its eyes and mouth."""
    right_eye, left_eye, _, right_mouth, left_mouth = np.array(box.landmarks_px)
    upright = float(np.hypot(*(0.5 * (right_eye + left_eye) - 0.5 * (right_mouth + left_mouth))))
    return max(float(np.hypot(*(left_eye - right_eye))), upright)


def _depth(a: Box, b: Box, geometry: PairGeometry) -> float:
    """Return by how many standard deviations the parallax differs from that of a person of this size."""
    seen_rad = _eye_distance(a) / geometry.left.fx_px
    expected_rad = seen_rad * geometry.kinematics.baseline_m / _EYE_DISTANCE_M
    parallax_rad = geometry.parallax_rad(a.point_px, b.point_px)
    sigma = math.hypot(_EYE_DISTANCE_SIGMA, _JOINT_SIGMA_RAD / max(expected_rad, 1e-6))
    # A picture may be smaller than the person; nothing is much larger.
    nearer = parallax_rad / max(expected_rad, 1e-6)
    return (math.log(nearer) if nearer > 1.0 else nearer - 1.0) / sigma


def _huber(deviation: float) -> float:
    """Return a deviation squared, beyond the knee only in proportion."""
    size = abs(deviation)
    return size**2 if size <= _KNEE else _KNEE * (2.0 * size - _KNEE)
