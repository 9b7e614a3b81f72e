"""The smallest steps of the joints: the driver's own, put into the rig's description."""

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from vergence_rig.parameters import ParameterError
from vergence_rig.rig import JOINT_NAMES, Joints, Rig

Array = npt.NDArray[np.float64]


def pulse_steps_rad(rig: Rig) -> Array:
    """Return the smallest step of each joint (3,) [rad]."""
    return np.array([joint.servo.pulse_step_rad for _, joint in rig.joints.items()])


def rig_with_steps(rig: Rig, steps_rad: Mapping[str, float]) -> Rig:
    """Return the rig with these steps [rad] by joint; joints not named, and invalid steps, keep the described ones."""
    joints = dict(rig.joints.items())
    for name in JOINT_NAMES:
        step_rad = steps_rad.get(name, math.nan)
        if not (math.isfinite(step_rad) and step_rad >= 0):
            continue
        try:
            servo = joints[name].servo.replaced(pulse_step_rad=float(step_rad))
        except ParameterError:
            continue
        joints[name] = replace(joints[name], servo=servo)
    return replace(rig, joints=Joints(**joints))
