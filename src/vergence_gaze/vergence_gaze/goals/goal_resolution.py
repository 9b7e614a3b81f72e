"""From a goal to the requested target: its first angles, their covariance, and whether they are reachable."""

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from vergence_gaze.estimation.directions import spread_of_eye, unseen_by_any_lens
from vergence_gaze.estimation.rays import gaze_of_ray, gaze_of_rays
from vergence_gaze.goals.goal import Goal, GoalError, GoalKind, Result
from vergence_gaze.joints.shaft_history import ShaftHistory
from vergence_gaze.parameters import LONGEST_GOAL_S, GazeParameters
from vergence_rig.geometry import EyeAngles, GeometryError, from_version_vergence
from vergence_rig.kinematics import Kinematics
from vergence_rig.rig import Rig

Array = npt.NDArray[np.float64]

_REACH_TOLERANCE_RAD = math.radians(0.5)
_POINT_SIGMA_RAD = 0.01
_CLICK_SIGMA_RAD = 0.002
_PRESENT_VERGENCE_BOUNDS_RAD = (0.03, 0.14)


@dataclass(frozen=True)
class RequestedTarget:
    """Version, vergence, tilt (3,) that fixate the target and their covariance (3, 3), as seen at `stamp_s`."""

    stamp_s: float
    angles_rad: Array
    covariance: Array


@dataclass(frozen=True)
class RequestedPose:
    """Joint angles (3,) [rad] to go to, without a target."""

    joints_rad: Array


@dataclass(frozen=True)
class ClassRequest:
    """A detected class to find and verge on."""

    class_name: str


@dataclass(frozen=True)
class MotionRequest:
    """Whatever moves next."""


Request: TypeAlias = RequestedTarget | RequestedPose | ClassRequest | MotionRequest


def resolve_goal(
    goal: Goal,
    rig: Rig,
    kinematics: Kinematics,
    parameters: GazeParameters,
    history: ShaftHistory,
    now_s: float,
    fault: str = "",
) -> Request:
    """Return what a goal requests; raises GoalError (INVALID or UNREACHABLE).

    `fault` says why no joint is known, if none is.
    """
    if not 0 <= goal.time_limit_s <= LONGEST_GOAL_S:
        allowed = f"time_limit_s must be 0 (default) to {LONGEST_GOAL_S:g} [s]"
        raise GoalError(Result.INVALID, f"{allowed}: got {goal.time_limit_s!r}")
    if not goal.max_speed_rad_s > 0:
        got = goal.max_speed_rad_s
        raise GoalError(Result.INVALID, f"the largest speed must be above 0, or 0 for no limit [rad/s]: got {got!r}")
    if not 0 <= goal.min_duration_s <= LONGEST_GOAL_S:
        got = goal.min_duration_s
        raise GoalError(Result.INVALID, f"the least duration must be 0 to {LONGEST_GOAL_S:g} [s]: got {got!r}")
    if goal.kind is GoalKind.CLASS:
        if not goal.class_name:
            raise GoalError(Result.INVALID, "class_name must be one of the detector's classes: got an empty text")
        return ClassRequest(goal.class_name)
    if goal.kind is GoalKind.MOTION:
        return MotionRequest()
    if not history.known:
        raise GoalError(Result.INVALID, f"joint_states must have arrived before a goal: {fault or 'none has'}")
    if goal.kind in (GoalKind.ANGLES, GoalKind.RELATIVE_ANGLES):
        return _pose(goal, rig, parameters, history)
    stamp_s = goal.stamp_s if math.isfinite(goal.stamp_s) and history.covers(goal.stamp_s) else now_s
    try:
        if goal.kind is GoalKind.POINT:
            target = _point(goal, kinematics, stamp_s)
        elif goal.kind is GoalKind.PIXEL:
            target = _pixel(goal, kinematics, parameters, history.shaft_at(stamp_s), stamp_s)
        else:
            target = _stereo_pixel(goal, rig, kinematics, history.shaft_at(stamp_s), stamp_s)
    except GeometryError as error:
        raise GoalError(Result.UNREACHABLE, str(error)) from error
    _check_reach(from_version_vergence(*(float(angle) for angle in target.angles_rad)).as_dict(), rig, parameters)
    return target


def _pose(goal: Goal, rig: Rig, parameters: GazeParameters, history: ShaftHistory) -> RequestedPose:
    angles = (goal.version_rad, goal.vergence_rad, goal.tilt_rad)
    if not all(math.isfinite(angle) for angle in angles):
        raise GoalError(Result.INVALID, f"version, vergence, tilt must be finite angles [rad]: got {angles}")
    present = history.reported_rad
    eyes = from_version_vergence(*angles)
    joints = np.array([eyes.pan_left_rad, eyes.pan_right_rad, eyes.tilt_rad])
    relative = goal.kind is GoalKind.RELATIVE_ANGLES
    if relative:
        joints = joints + present
    short_rad = rig.least_vergence_rad - float(joints[1] - joints[0])
    if short_rad > 0.0 and relative and goal.vergence_rad >= 0.0:
        # Eyes that were stopped on their way may diverge by a little: they are brought to where they may be.
        joints += np.array([-0.5, 0.5, 0.0]) * short_rad
    elif short_rad > 1e-6:
        raise GoalError(
            Result.UNREACHABLE,
            f"the vergence must be at least {rig.least_vergence_rad:g} rad: got {joints[1] - joints[0]:.4f}",
        )
    _check_reach(dict(zip(("pan_left", "pan_right", "tilt"), joints.tolist(), strict=True)), rig, parameters)
    return RequestedPose(joints)


def _point(goal: Goal, kinematics: Kinematics, stamp_s: float) -> RequestedTarget:
    eyes = kinematics.gaze_for_point(goal.point_m)
    return RequestedTarget(stamp_s, _angles(eyes), np.eye(3) * _POINT_SIGMA_RAD**2)


def _pixel(
    goal: Goal, kinematics: Kinematics, parameters: GazeParameters, joints: Array, stamp_s: float
) -> RequestedTarget:
    left, xy = goal.left_eye, (goal.left_xy if goal.left_eye else goal.right_xy)
    _check_seen("the pixel", xy)
    own_pan = joints[0] if left else joints[1]
    if math.isfinite(goal.depth_m) and goal.depth_m > 0:
        ray = kinematics.rotation_rig_from_optical(own_pan, joints[2]) @ (*xy, 1.0)
        place = kinematics.lens(left, own_pan, joints[2]) + goal.depth_m * ray / np.linalg.norm(ray)
        eyes = kinematics.gaze_for_point(place)
        # A stated depth is good to a tenth or so.
        sigma = 0.1 * max(abs(eyes.vergence_rad), 0.04)
        return RequestedTarget(stamp_s, _angles(eyes), spread_of_eye(left, _CLICK_SIGMA_RAD, sigma))
    # Without depth the eyes keep their present vergence: all of it where they already look, elsewhere as far as it
    # leaves both directions open.
    at_fovea = math.atan(math.hypot(*xy)) <= parameters.saccade.threshold_rad
    lowest, highest = _PRESENT_VERGENCE_BOUNDS_RAD
    vergence = float(np.clip(joints[1] - joints[0], lowest, math.inf if at_fovea else highest))
    eyes, slopes = gaze_of_ray(kinematics, left, joints, xy, vergence)
    spread = spread_of_eye(left, _CLICK_SIGMA_RAD, parameters.target.prior_vergence_sigma_rad, slopes)
    return RequestedTarget(stamp_s, _angles(eyes), spread)


def _stereo_pixel(goal: Goal, rig: Rig, kinematics: Kinematics, joints: Array, stamp_s: float) -> RequestedTarget:
    _check_seen("the pixels", (*goal.left_xy, goal.right_xy[0]))
    angles = _angles(gaze_of_rays(kinematics, joints, joints, goal.left_xy, goal.right_xy[0]))
    if angles[1] < rig.least_vergence_rad - _REACH_TOLERANCE_RAD:
        raise GoalError(
            Result.UNREACHABLE,
            f"the rays of the two pixels must meet: they diverge by {-math.degrees(angles[1]):.1f} deg",
        )
    return RequestedTarget(stamp_s, angles, np.eye(3) * (2.0 * _CLICK_SIGMA_RAD) ** 2)


def _angles(eyes: EyeAngles) -> Array:
    """Return version, vergence, tilt (3,)."""
    return np.array([eyes.version_rad, eyes.vergence_rad, eyes.tilt_rad])


def _check_seen(what: str, normalised: tuple[float, ...]) -> None:
    if fault := unseen_by_any_lens(normalised):
        raise GoalError(Result.INVALID, f"{what} must be one that the lens can see: {fault}")


def _check_reach(joints_rad: dict[str, float], rig: Rig, parameters: GazeParameters) -> None:
    held = {"left_held": "pan_left", "right_held": "pan_right"}.get(parameters.control.mode)
    for name, joint in rig.joints.items():
        if name == held or (name == "tilt" and not parameters.control.tilt_enabled):
            continue
        angle = joints_rad[name]
        if not joint.lower_rad - _REACH_TOLERANCE_RAD <= angle <= joint.upper_rad + _REACH_TOLERANCE_RAD:
            raise GoalError(
                Result.UNREACHABLE,
                f"{name} must be {math.degrees(joint.lower_rad):.1f} to {math.degrees(joint.upper_rad):.1f} deg: "
                f"the goal needs {math.degrees(angle):.1f}",
            )
