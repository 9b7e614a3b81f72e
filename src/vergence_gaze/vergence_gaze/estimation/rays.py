"""What the eyes see as rays: the eye angles that would bring a seen thing to the foveas.

A lens that is not on its axes moves as its eye turns, so that the angles which a seen direction asks for depend on the
distance a little. One eye alone gives them for an assumed vergence, with their slope over it; both eyes give them all.
"""

import math

import numpy as np
import numpy.typing as npt

from vergence_rig.geometry import EyeAngles
from vergence_rig.kinematics import FarPoint, Kinematics, Place

Array = npt.NDArray[np.float64]

_NEAR_RAD = 0.1


def gaze_of_ray(
    kinematics: Kinematics, left: bool, angles_rad: Array, xy: tuple[float, float], vergence_rad: float
) -> tuple[EyeAngles, tuple[float, float]]:
    """Return the eye angles for what one eye sees at normalised coordinates, and how its pan and the tilt vary.

    Args:
        kinematics: of the head.
        left: which eye sees it.
        angles_rad: eye angles (3,) at the exposure.
        xy: normalised coordinates, x right, y down.
        vergence_rad: assumed of the target.

    Returns:
        The angles at that vergence, and d (own pan, tilt) / d vergence.

    Raises UnreachableError where no angles bring the ray to the fovea.
    """
    lens, ray = _ray(kinematics, left, angles_rad, xy)
    far, near = (_gaze_at(kinematics, lens, ray, w) for w in (0.0, _NEAR_RAD / kinematics.baseline_m))
    across = near.vergence_rad - far.vergence_rad
    w = (vergence_rad - far.vergence_rad) / across * _NEAR_RAD / kinematics.baseline_m
    eyes = _gaze_at(kinematics, lens, ray, w)
    pan = (near.pan_left_rad - far.pan_left_rad) if left else (near.pan_right_rad - far.pan_right_rad)
    return eyes, (pan / across, (near.tilt_rad - far.tilt_rad) / across)


def gaze_of_rays(
    kinematics: Kinematics, left_rad: Array, right_rad: Array, left_xy: tuple[float, float], right_x: float
) -> EyeAngles:
    """Return the eye angles for what both eyes see, at normalised coordinates of which the right eye's y is not used.

    The eye angles (3,) at the left and at the right exposure may differ. The point is where the left eye's ray meets
    the plane of the right image's column, at infinity or behind the eyes too. Raises UnreachableError.
    """
    lens, ray = _ray(kinematics, True, left_rad, left_xy)
    pan, tilt = float(right_rad[1]), float(right_rad[2])
    column = kinematics.seen_direction(pan, tilt, 1.0, 0.0, -right_x)
    x, y, z = kinematics.lens_place(False, pan, tilt)
    apart = x - lens[0], y - lens[1], z - lens[2]
    return _gaze_at(kinematics, lens, ray, _dot(column, ray) / _dot(column, apart))


def _ray(kinematics: Kinematics, left: bool, angles_rad: Array, xy: tuple[float, float]) -> tuple[Place, Place]:
    """Return an eye's lens and the unit ray of normalised coordinates, in rig_base."""
    pan, tilt = float(angles_rad[0 if left else 1]), float(angles_rad[2])
    length = math.hypot(*xy, 1.0)
    ray = kinematics.seen_direction(pan, tilt, xy[0] / length, xy[1] / length, 1.0 / length)
    return kinematics.lens_place(left, pan, tilt), ray


def _gaze_at(kinematics: Kinematics, lens: Place, ray: Place, w: float) -> EyeAngles:
    """Return the angles for the point on a ray at the inverse distance `w` [1/m] from the lens."""
    x, y, z = (along + w * start for along, start in zip(ray, lens, strict=True))
    return kinematics.gaze(FarPoint(x, y, z, w))


def _dot(one: Place, other: Place) -> float:
    return one[0] * other[0] + one[1] * other[1] + one[2] * other[2]
