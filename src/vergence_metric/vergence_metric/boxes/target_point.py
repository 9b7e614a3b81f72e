"""Where the target is in space: from its directions in both eyes and the joint angles, with covariance.

As in binocular harvesting heads: detector, matching inside the region, mean disparity, triangulation.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vergence_rig.camera import CameraModel
from vergence_rig.geometry import EyeAngles, GeometryError, nearest_points_of_rays
from vergence_rig.kinematics import Kinematics

Array = NDArray[np.float64]

_SIGMAS_95 = 1.96


@dataclass(frozen=True)
class TargetPoint:
    """A point (3,) in rig_base [m] and its covariance (3, 3) [m^2].

    `interval_m` is the interval of its distance from rig_base that holds the true one with a probability of 95 %; inf
    where it may be any distance away. It is not symmetric: the distance goes with the reciprocal of the vergence.
    """

    point_m: Array
    covariance_m2: Array
    interval_m: tuple[float, float]

    @property
    def distance_m(self) -> float:
        """The distance from rig_base."""
        return float(np.linalg.norm(self.point_m))


def locate(
    left_px: tuple[float, float],
    right_px: tuple[float, float],
    cameras: tuple[CameraModel, CameraModel],
    eyes: EyeAngles,
    kinematics: Kinematics,
    sigmas: tuple[float, float, float],
) -> TargetPoint | None:
    """Triangulate one point seen by both eyes; None where the rays do not meet in front.

    Args:
        left_px: (x, y) of it in the left image.
        right_px: in the right image.
        cameras: left and right.
        eyes: joint angles at the images' stamps.
        kinematics: of the head.
        sigmas: standard deviations of a direction common to both eyes [px], of the disparity [px], and of each joint
            angle [rad].

    """
    direction_px, disparity_px, joint_rad = sigmas
    # x and y of both eyes together, x of the right eye alone (disparity), then the joints.
    deviations = np.array([direction_px, direction_px, disparity_px, joint_rad, joint_rad, joint_rad])

    def point(offsets: Array) -> Array:
        moved = EyeAngles(eyes.pan_left_rad + offsets[3], eyes.pan_right_rad + offsets[4], eyes.tilt_rad + offsets[5])
        left = (left_px[0] + offsets[0], left_px[1] + offsets[1])
        right = (right_px[0] + offsets[0] - offsets[2], right_px[1] + offsets[1])
        return meeting(left, right, cameras, moved, kinematics)

    try:
        center = point(np.zeros(6))
        columns = []
        for i, deviation in enumerate(deviations):
            step = np.zeros(6)
            step[i] = 0.5 * deviation
            columns.append(point(step) - point(-step))
    except GeometryError:
        return None
    # All that turns the eyes against each other, as a turn of the right one.
    turn_rad = math.hypot(disparity_px / cameras[1].fx_px, joint_rad, joint_rad)
    interval = []
    for sign in (1.0, -1.0):
        step = np.zeros(6)
        step[4] = sign * _SIGMAS_95 * turn_rad
        try:
            interval.append(float(np.linalg.norm(point(step))))
        except GeometryError:
            interval.append(math.inf)
    spread = np.column_stack(columns)
    return TargetPoint(center, np.asarray(spread @ spread.T), (interval[0], interval[1]))


def meeting(
    left_px: tuple[float, float],
    right_px: tuple[float, float],
    cameras: tuple[CameraModel, CameraModel],
    eyes: EyeAngles,
    kinematics: Kinematics,
) -> Array:
    """Return the point (3,) in rig_base [m] between the rays of a left and a right pixel, where they come closest.

    Raises GeometryError where they do not meet in front.
    """
    rays = []
    for left, camera, pan, pixel in zip(
        (True, False), cameras, (eyes.pan_left_rad, eyes.pan_right_rad), (left_px, right_px), strict=True
    ):
        turn = kinematics.rotation_rig_from_optical(pan, eyes.tilt_rad)
        rays += [kinematics.lens(left, pan, eyes.tilt_rad), turn @ camera.pixel_to_ray([pixel])[0]]
    a, b = nearest_points_of_rays(*rays)
    return np.asarray(0.5 * (a + b))
