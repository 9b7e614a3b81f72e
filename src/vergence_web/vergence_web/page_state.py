"""The state that the page shows, from the newest messages of the graph, as values for JSON.

Messages are read by their fields only; no ROS here. A figure that is not known is null.
"""

import contextlib
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from vergence_rig.geometry import EyeAngles, GeometryError
from vergence_rig.kinematics import Kinematics
from vergence_rig.rig import JOINT_NAMES, Rig
from vergence_rig.verged import best_small_window

STALE_S = 1.5
"""A message that is older is no longer shown as the present."""
_CHI2_95_PERCENT_OF_TWO = 5.991
_LONGEST_TEXT = 300
_MOST_BOXES, _MOST_WINDOWS = 50, 20
_DIGITS = 5


@dataclass(frozen=True)
class Newest:
    """The newest message of a topic and its age since it arrived [s]."""

    message: Any
    age_s: float


Messages = Mapping[str, Newest]


def figure(value: float, digits: int = _DIGITS) -> float | None:
    """Return a number for JSON, None for one that is not finite."""
    return round(float(value), digits) if math.isfinite(value) else None


def text(value: str) -> str:
    """Return a text of a message, shortened: it may come from anywhere."""
    return value[:_LONGEST_TEXT]


class PageState:
    """Builds the state of a head."""

    def __init__(self, rig: Rig) -> None:
        self._rig, self._kinematics = rig, Kinematics(rig)

    def build(self, messages: Messages) -> dict[str, Any]:
        """Return the state of the newest messages, by topic; what is missing or old is null."""
        fresh = {topic: newest.message for topic, newest in messages.items() if newest.age_s < STALE_S}
        seen, wanted = (self._eyes(fresh.get(topic)) for topic in ("joint_states", "joint_command"))
        gaze = fresh.get("gaze/state")
        return {
            "gaze": None if gaze is None else _gaze(gaze),
            "seen": _angles(seen),
            "wanted": _angles(wanted),
            "edge": _given(_edge, fresh.get("vergence/edge")),
            "error": _given(_error, fresh.get("vergence/error")),
            "track": _given(_track, fresh.get("vergence/track")),
            "box": _given(_box_state, fresh.get("vergence/box")),
            "detections": _given(_detections, fresh.get("vergence/detections")),
            "head": self._head(seen, gaze),
        }

    def _eyes(self, message: Any) -> EyeAngles | None:
        """Return the angles of the optical axes at a JointState's angles; None if a joint is missing."""
        if message is None:
            return None
        joints = dict(zip(message.name, message.position, strict=False))
        if not all(name in joints and math.isfinite(joints[name]) for name in JOINT_NAMES):
            return None
        return EyeAngles(*self._rig.eye_angles([joints[name] for name in JOINT_NAMES]))

    def _head(self, seen: EyeAngles | None, gaze: Any) -> dict[str, Any] | None:
        """Return the head from above: x forward, y left of rig_base [m]; the axes by the joints, the rest by the gaze.

        Lenses and the unit vectors of the optical axes are (x, y) of the left and the right eye.
        """
        if seen is None:
            return None
        pans = ((True, seen.pan_left_rad), (False, seen.pan_right_rad))
        view: dict[str, Any] = {
            "lenses": [_xy(self._kinematics.lens(left, pan, seen.tilt_rad)) for left, pan in pans],
            "axes": [_xy(self._kinematics.axis(pan, seen.tilt_rad)) for _, pan in pans],
            "fixation": None,
            "target": None,
            "ellipse": None,
        }
        with contextlib.suppress(GeometryError):  # the axes need not meet
            view["fixation"] = _xy(self._kinematics.point_at(seen.version_rad, seen.vergence_rad, seen.tilt_rad))
        if gaze is not None and math.isfinite(gaze.target.x):
            view["target"] = _xy((gaze.target.x, gaze.target.y))
            view["ellipse"] = ellipse_95(np.asarray(gaze.target_covariance, dtype=np.float64).reshape(3, 3))
        return view


def ellipse_95(covariance_m2: npt.NDArray[np.float64]) -> dict[str, float] | None:
    """Return the 95 % ellipse in x and y of a covariance (3, 3): half axes [m], direction of the longer one [rad].

    None where the covariance is not known.
    """
    ground = covariance_m2[:2, :2]
    if not np.isfinite(ground).all():
        return None
    values, vectors = np.linalg.eigh(ground)
    short, long = np.sqrt(np.maximum(values, 0.0) * _CHI2_95_PERCENT_OF_TWO)
    angle_rad = math.atan2(vectors[1, 1], vectors[0, 1])
    return {"long_m": round(float(long), 5), "short_m": round(float(short), 5), "angle_rad": round(angle_rad, 5)}


def _given(build: Any, message: Any) -> Any:
    return None if message is None else build(message)


def _xy(point: Iterable[float]) -> list[float | None]:
    return [figure(value, 4) for value in list(point)[:2]]


def _angles(eyes: EyeAngles | None) -> dict[str, float | None] | None:
    if eyes is None:
        return None
    return {
        "version_rad": figure(eyes.version_rad),
        "vergence_rad": figure(eyes.vergence_rad),
        "tilt_rad": figure(eyes.tilt_rad),
    }


def _gaze(state: Any) -> dict[str, Any]:
    names = (
        "version_rad vergence_rad tilt_rad version_residual_rad vergence_residual_rad tilt_residual_rad "
        "residual_px contrast distance_m distance_low_m miss_distance_m"
    )
    return {
        "phase": text(state.phase_name),
        "reason": text(state.reason),
        "law": text(state.law),
        "mode": text(state.mode),
        "verged": bool(state.verged),
        "moving": bool(state.target_moving),
        **{name: figure(getattr(state, name)) for name in names.split()},
        # +inf: parallel axes cannot be excluded.
        "distance_high_m": "infinite" if state.distance_high_m == math.inf else figure(state.distance_high_m),
        "target": [figure(value, 4) for value in (state.target.x, state.target.y, state.target.z)],
    }


def _edge(edge: Any) -> dict[str, Any]:
    windows, contrast = list(edge.windows_px)[:_MOST_WINDOWS], list(edge.contrast)[:_MOST_WINDOWS]
    return {
        "windows_px": [int(size) for size in windows],
        "left_to_right_px": [figure(value, 3) for value in edge.left_to_right_px[:_MOST_WINDOWS]],
        "right_to_left_px": [figure(value, 3) for value in edge.right_to_left_px[:_MOST_WINDOWS]],
        "contrast": [figure(value, 3) for value in contrast],
        "status": [int(status) for status in edge.status[:_MOST_WINDOWS]],
        "best": best_small_window(windows, contrast),
        "verged": bool(edge.verged),
    }


def _error(error: Any) -> dict[str, Any]:
    names = ("horizontal_px", "vertical_px", "sigma_px", "confidence", "horizontal_rad")
    return {
        **{name: figure(getattr(error, name)) for name in names},
        "estimator": text(error.estimator),
        "status": int(error.status),
        "reason": text(error.reason),
    }


def _track(track: Any) -> dict[str, Any]:
    return {
        "left": [figure(track.left_x_px, 1), figure(track.left_y_px, 1)],
        "right": [figure(track.right_x_px, 1), figure(track.right_y_px, 1)],
        "extent": [figure(track.extent_width_px, 1), figure(track.extent_height_px, 1)],
        "disparity_px": figure(track.disparity_px, 3),
        "sigma_px": figure(track.sigma_px, 3),
        "confidence": figure(track.confidence, 3),
        "goal": int(track.goal_id),
        "status": int(track.status),
        "reason": text(track.reason),
    }


def _box_state(box: Any) -> dict[str, Any]:
    return {"class": text(box.class_name), "status": int(box.status), "reason": text(box.reason)}


def _detections(message: Any) -> dict[str, Any]:
    stamp = message.header.stamp
    return {
        "stamp": str(stamp.sec * 1_000_000_000 + stamp.nanosec),
        "left": [_box(box) for box in message.left[:_MOST_BOXES]],
        "right": [_box(box) for box in message.right[:_MOST_BOXES]],
    }


def _box(box: Any) -> dict[str, Any]:
    sides = (box.x_min_px, box.y_min_px, box.x_max_px, box.y_max_px)
    return {"class": text(box.class_name), "score": figure(box.score, 2), "xyxy": [figure(side, 1) for side in sides]}
