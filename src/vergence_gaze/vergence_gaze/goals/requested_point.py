"""A point requested in space: the eyes turn there by the joints; only what is seen to lie there corrects them."""

import math

import numpy as np
import numpy.typing as npt

from vergence_gaze.goals.goal import TrackRequest
from vergence_gaze.target_parameters import TargetParameters
from vergence_rig.geometry import EyeAngles
from vergence_rig.kinematics import Kinematics

Array = npt.NDArray[np.float64]


class RequestedPoint:
    """The requested joint angles, whether the eyes rest there, and what the tracker has answered.

    Args:
        goal_id: of the goal.
        joints_rad: pan_left, pan_right, tilt (3,) that fixate the point.
        kinematics: of the head.
        parameters: tolerances and times.
        answer_within_s: time in which an answer of the tracker is waited for.
    """

    def __init__(
        self,
        goal_id: int,
        joints_rad: Array,
        kinematics: Kinematics,
        parameters: TargetParameters,
        answer_within_s: float,
    ) -> None:
        self.goal_id, self._joints_rad, self._p = goal_id, joints_rad, parameters
        self._kinematics = kinematics
        self._answer_within_s = answer_within_s
        self._rested_since_s = math.nan
        self._asked = self._answered = self._confirmed = False
        self._note = "no image shows anything there that can be tracked"

    def request(self, resting: bool, now_s: float, stamp_s: float, joints_rad: Array) -> TrackRequest | None:
        """Return what to ask the tracker, once: what an image of eyes at rest shows in the point's direction.

        Args:
            resting: whether the eyes rest within a saccade's threshold of the point.
            now_s: the present.
            stamp_s: of the newest left image of eyes at rest, NaN if there is none.
            joints_rad: the joint angles (3,) then.
        """
        if not resting:
            self._rested_since_s = math.nan
            return None
        if math.isnan(self._rested_since_s):
            self._rested_since_s = now_s
        if self._asked or not stamp_s >= self._rested_since_s:
            return None
        pan, _, tilt = joints_rad
        point = self._kinematics.far_point(EyeAngles(*(float(angle) for angle in self._joints_rad)))
        ray = np.array([point.x, point.y, point.z]) - point.w * self._kinematics.lens(True, pan, tilt)
        x, y, z = ray @ self._kinematics.rotation_rig_from_optical(pan, tilt)
        self._asked = True
        return TrackRequest(self.goal_id, stamp_s, True, (float(x / z), float(y / z)))

    def on_answer(self) -> None:
        """Note that the tracker has answered, whatever it says."""
        self._answered = True

    def objection(self, seen_rad: Array) -> str:
        """Return why what is seen at joint angles (3,) does not lie at the point; "" if it does."""
        off_rad = np.abs(seen_rad - self._joints_rad)
        vergence_off_rad = abs(float((seen_rad[1] - seen_rad[0]) - (self._joints_rad[1] - self._joints_rad[0])))
        if not max(off_rad[0], off_rad[2]) <= self._p.point_tolerance_rad:
            self._note = f"what is tracked lies {math.degrees(max(off_rad[0], off_rad[2])):.1f} deg beside it"
        elif not vergence_off_rad <= self._p.point_tolerance_rad:
            seen_deg = math.degrees(seen_rad[1] - seen_rad[0])
            unknown = "what is seen in its direction has no known distance"
            known = f"what is seen in its direction needs {seen_deg:.1f} deg of vergence"
            self._note = known if math.isfinite(seen_deg) else unknown
        else:
            self._confirmed = True
            return ""
        return self._note

    def reached(self, now_s: float) -> str:
        """Return why the point counts as looked at although nothing is seen there; "" while that is open."""
        wait_s = self._p.point_dwell_s if self._answered else self._answer_within_s
        if self._confirmed or not now_s - self._rested_since_s > wait_s:
            return ""
        return f"the eyes look at the requested point by their joints: {self._note}"
