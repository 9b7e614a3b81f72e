"""What the eyes see as rays: the eye angles that would bring a seen thing to the foveas.

A lens that is not on its axes moves as its eye turns, so that the angles which a seen direction asks for depend on the
distance a little. One eye alone gives them for an assumed vergence, with their slope over it; both eyes give them all.
"""

import numpy as np
import numpy.typing as npt

from vergence_rig.geometry import EyeAngles
from vergence_rig.kinematics import FarPoint, Kinematics

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
    column = kinematics.rotation_rig_from_optical(right_rad[1], right_rad[2]) @ (1.0, 0.0, -right_x)
    across = float(column @ (kinematics.lens(False, right_rad[1], right_rad[2]) - lens))
    w = float(column @ ray) / across
    return _gaze_at(kinematics, lens, ray, w)


def _ray(kinematics: Kinematics, left: bool, angles_rad: Array, xy: tuple[float, float]) -> tuple[Array, Array]:
    """Return an eye's lens (3,) and the unit ray (3,) of normalised coordinates, in rig_base."""
    pan, tilt = angles_rad[0 if left else 1], angles_rad[2]
    ray = kinematics.rotation_rig_from_optical(pan, tilt) @ (xy[0], xy[1], 1.0)
    return kinematics.lens(left, pan, tilt), ray / np.linalg.norm(ray)


def _gaze_at(kinematics: Kinematics, lens: Array, ray: Array, w: float) -> EyeAngles:
    """Return the angles for the point on a ray at the inverse distance `w` [1/m] from the lens."""
    x, y, z = (ray + w * lens).tolist()
    return kinematics.gaze(FarPoint(x, y, z, w))
