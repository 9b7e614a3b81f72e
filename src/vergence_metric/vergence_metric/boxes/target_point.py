"""Where the target is in space: from its directions in both eyes and the joint angles, with covariance.

As in binocular harvesting heads: detector, matching inside the region, mean disparity, triangulation.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vergence_rig.camera import CameraModel
from vergence_rig.geometry import EyeAngles, GeometryError, nearest_points_of_rays
from vergence_rig.kinematics import Kinematics

Array = NDArray[np.float64]


@dataclass(frozen=True)
class TargetPoint:
    """A point (3,) in rig_base [m] and its covariance (3, 3) [m^2]."""

    point_m: Array
    covariance_m2: Array


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
    spread = np.column_stack(columns)
    return TargetPoint(center, np.asarray(spread @ spread.T))


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
