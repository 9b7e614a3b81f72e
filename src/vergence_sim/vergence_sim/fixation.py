"""Turns a simulated head onto a target at once, with a chosen vergence error: for studies of images."""

import numpy as np
from numpy.typing import NDArray

from vergence_rig.kinematics import Kinematics
from vergence_rig.rig import JOINT_NAMES
from vergence_sim.simulator import Simulator, StereoFrame


def fixated_surface(simulator: Simulator, target: str, centre_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Place a target and return the point of its surface (3,) [m] in rig_base that a verged gaze meets."""
    simulator.place_target(target, centre_m)
    return np.asarray(simulator.truth().target_point_m, np.float64)


def look_at(simulator: Simulator, point_m: NDArray[np.float64], vergence_error_rad: float) -> StereoFrame:
    """Return the pair with the left eye on a point (3,) [m] in rig_base and the right eye off by an angle [rad].

    A positive error means that the eyes have to converge more, as in VergenceError.
    """
    real = simulator.head.real
    eyes = Kinematics(real).gaze_for_point(point_m)
    joints = real.joint_angles((eyes.pan_left_rad, eyes.pan_right_rad - vergence_error_rad, eyes.tilt_rad))
    simulator.set_head(dict(zip(JOINT_NAMES, joints, strict=True)))
    return simulator.capture()
