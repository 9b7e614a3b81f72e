"""Which angles bring a point to both foveas, found on MuJoCo's model of the head alone, not with vergence_rig.

A fovea is the optical axis of an eye as rig.yaml defines it: from the lens, straight ahead in the camera's yaw and the
mean pitch of both cameras, since two pans and one tilt cannot level cameras that are pitched differently.
"""

import math

import mujoco
import numpy as np
import numpy.typing as npt

from vergence_rig.head_bodies import EYES, PAN_LINKS
from vergence_rig.head_mjcf import mjcf_bodies, quaternion_text
from vergence_rig.rig import JOINT_NAMES, Rig

Array = npt.NDArray[np.float64]

_STEPS, _CONVERGED_RAD, _DIFFERENCE_RAD = 30, 1e-11, 1e-4
_LARGEST_STEP_RAD = 0.3


def fovea_sites(rig: Rig) -> dict[str, str]:
    """Return MuJoCo's sites `left_fovea` and `right_fovea`, x along the axis, for the bodies they belong in."""
    sites = {}
    for eye in EYES:
        mount = rig.mount(eye == "left")
        place = f"{mount.lens_x_m!r} {mount.lens_y_m!r} {mount.lens_z_m!r}"
        turn = quaternion_text((0.0, rig.mean_pitch_rad, mount.yaw_rad))
        sites[PAN_LINKS[eye]] = f'<site name="{eye}_fovea" pos="{place}" quat="{turn}" group="3"/>'
    return sites


class TrueGaze:
    """Turns the head alone, in a model of its own."""

    def __init__(self, head: Rig) -> None:
        bodies = mjcf_bodies(head, fovea_sites(head), shapes=False)
        self._model = mujoco.MjModel.from_xml_string(
            f'<mujoco><compiler angle="radian"/><worldbody>{bodies}</worldbody></mujoco>'
        )
        self._data = mujoco.MjData(self._model)
        self._hinges = [int(self._model.joint(name).qposadr[0]) for name in JOINT_NAMES]
        self._sites = [self._model.site(f"{eye}_fovea").id for eye in EYES]
        self._half_m = 0.5 * head.baseline_m

    def hinges(self, point_m: Array) -> Array:
        """Return pan_left, pan_right and tilt (3,) [rad] of the hinges that bring a point (3,) to both foveas.

        The point is in rig_base [m]. The tilt levels the mean of both eyes' angles to it. NaN where no angles do.
        """
        x, y, z = point_m.tolist()
        forward = math.hypot(x, z)
        angles = np.array([math.atan2(y - self._half_m, forward), math.atan2(y + self._half_m, forward), 0.0])
        angles[2] = math.atan2(-z, x)
        off = self._off(angles, point_m)
        slopes = np.column_stack(
            [(self._off(angles + step, point_m) - off) / _DIFFERENCE_RAD for step in _DIFFERENCE_RAD * np.eye(3)]
        )
        for _ in range(_STEPS):
            if np.abs(off).max() < _CONVERGED_RAD:
                return angles
            try:
                step = np.linalg.solve(slopes, -off)
            except np.linalg.LinAlgError:
                break
            step *= min(1.0, _LARGEST_STEP_RAD / float(np.abs(step).max()))
            angles = angles + step
            after = self._off(angles, point_m)
            # Broyden's update: the slopes change little on the way.
            slopes += np.outer(after - off - slopes @ step, step) / float(step @ step)
            off = after
        return angles if np.abs(off).max() < 1e-8 else np.full(3, math.nan)

    def _off(self, angles: Array, point_m: Array) -> Array:
        """Return the point's azimuths from both axes and its mean angle above them (3,) [rad]."""
        data = self._data
        data.qpos[self._hinges] = angles
        mujoco.mj_kinematics(self._model, data)
        aside, above = [], []
        for site in self._sites:
            x, y, z = ((point_m - data.site_xpos[site]) @ data.site_xmat[site].reshape(3, 3)).tolist()
            aside.append(math.atan2(y, x))
            above.append(math.atan2(z, x))
        return np.array([*aside, 0.5 * (above[0] + above[1])])
