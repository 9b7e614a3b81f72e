"""Which sightings are of the wanted target, and what they say of it: the way from observations into the filter.

The wanted target is given once (a click, a point, a class). From then on it is followed by the class-free tracker once
that has locked on it, by boxes of the wanted class, or by a stream of points; the disparity at the left fovea gives the
depth of whatever lies there, and counts while the target does.
"""

import math
from collections import deque

import numpy as np
import numpy.typing as npt

from vergence_rig.rig import Rig
from vergence_servo.gaze import directions
from vergence_servo.gaze.directions import SightingError
from vergence_servo.gaze.joint_history import JointHistory
from vergence_servo.gaze.laws.protocol import VisualError
from vergence_servo.gaze.observations import BoxSighting, FoveaDisparity, PointSighting, TrackSighting
from vergence_servo.gaze.parameters import GazeParameters
from vergence_servo.gaze.target_filter import Measurement, TargetEstimate, TargetFilter

Array = npt.NDArray[np.float64]

_TIMING_SIGMA_S = 0.003
_MOVE_VARIANCE_RAD = 8e-3
_TURN_SHARE = 0.35
_FIRST_SHARE = 0.6
_FRESH_S = 0.15
_DISAGREEING_PAIRS = 5
_SAME_DEPTH_RAD = 0.006
_SIGMA_BOUNDS_RAD = (1e-5, 0.5)
_WIDEST_RAD = 1.5


class TargetTracking:
    """Holds the filter and decides what goes into it."""

    def __init__(self, rig: Rig, parameters: GazeParameters, history: JointHistory) -> None:
        self._p = parameters
        self._history = history
        self._baseline_m = rig.baseline_m
        self.filter = TargetFilter(
            parameters.follow_acceleration_rad_s2,
            parameters.still_drift_rad_sqrt_s,
            parameters.gate_sigma,
            parameters.jump_count,
        )
        self._last_reported: Array | None = None
        self._last_direction = np.zeros(3)
        self._moves: deque[tuple[float, Array]] = deque(maxlen=200)
        self.clear()

    def clear(self) -> None:
        """No target is wanted."""
        self.filter.forget()
        self.class_name: str | None = None
        self.takes_stream = False
        self.visual: VisualError | None = None
        self.seen_s = math.nan
        self.source = ""
        self.note = ""
        self._track_id: int | None = None
        self._track_offset = (0.0, 0.0)
        self._track_seen_s = -math.inf
        self._wanted_since_s = -math.inf
        self._target_seen_s = -math.inf
        self._disagreeing = 0
        self._track_vergence: tuple[float, float, float] = (-math.inf, math.nan, 0.0)

    def want(self, now_s: float, stamp_s: float, angles_rad: Array, covariance: Array) -> None:
        """Begin with a target at version, vergence, tilt (3,) with this covariance (3, 3), as seen at `stamp_s`."""
        self.clear()
        self.filter.start(stamp_s, angles_rad, covariance)
        self._wanted_since_s = now_s
        self.seen_s = now_s

    def want_class(self, now_s: float, class_name: str) -> None:
        """Begin with any target of a detected class ("": of any class); nothing is known of it yet."""
        self.clear()
        self.class_name = class_name
        self._wanted_since_s = now_s

    def want_stream(self, now_s: float) -> None:
        """Begin with whatever point the stream names next."""
        self.clear()
        self.takes_stream = True
        self._wanted_since_s = now_s

    @property
    def disagreement(self) -> bool:
        """True while two estimators differ by more than the object's own depth explains."""
        return self._disagreeing >= _DISAGREEING_PAIRS

    @property
    def doubtful(self) -> bool:
        """True if estimators have just differed, though not for long enough to call it a disagreement."""
        return self._disagreeing > 0

    def estimate(self, time_s: float) -> TargetEstimate | None:
        """Return the target at `time_s`, or None if there is none."""
        return self.filter.at(time_s) if self.filter.initialised else None

    def note_motion(self) -> bool:
        """Take how the joints have moved in the newest report as doubt about their angles, from its stamp on.

        Returns whether a pan has moved.
        """
        reported = self._history.reported_rad
        if self._last_reported is None:
            self._last_reported = reported
            return True
        move = reported - self._last_reported
        if not np.any(move):
            return False
        self._last_reported = reported
        half_play = self._history.half_play_rad
        direction = np.sign(move)
        turned = (direction != 0) & (direction != self._last_direction)
        # Before its first move a shaft may lie anywhere in its play.
        share = np.where(self._last_direction == 0, _FIRST_SHARE, _TURN_SHARE)
        self._last_direction = np.where(direction != 0, direction, self._last_direction)
        variances = _MOVE_VARIANCE_RAD * half_play * np.abs(move) + turned * (share * half_play) ** 2
        if np.any(variances):
            self._moves.append((self._history.newest_s, variances))
        return bool(np.any(move[:2]))

    def _loosen_before(self, stamp_s: float) -> None:
        """Tell the filter of the moves before an exposure: an image from before a move knows nothing of its doubt."""
        while self._moves and self._moves[0][0] <= stamp_s:
            self.filter.loosen(self._moves.popleft()[1])

    def see_track(self, sighting: TrackSighting, now_s: float) -> bool:
        """Take a track; True if it was the target's and was believed."""
        if not sighting.usable or not self.eyes_were_still(sighting.stamp_s, sighting.skew_s):
            return False
        joints = self._history.shaft_at(sighting.stamp_s)
        pan, tilt = directions.direction_angles(joints[0], joints[2], sighting.left_x, sighting.left_y)
        if not self._is_wanted_track(sighting, pan, tilt):
            return False
        offset_pan, offset_tilt = self._track_offset
        sigma = self._sigma(sighting.stamp_s, self._p.direction_sigma_rad)
        if math.isfinite(sighting.disparity_rad):
            right_x = _tangent(math.atan(sighting.left_x) - sighting.disparity_rad)
            measurement, (left_pan, right_pan, seen_tilt) = directions.both_eyes(
                self._history,
                sighting.stamp_s,
                sighting.skew_s,
                (sighting.left_x, sighting.left_y),
                right_x,
                sigma,
                _positive(sighting.sigma_rad, self._p.direction_sigma_rad),
            )
            self._track_vergence = (sighting.stamp_s, right_pan - left_pan, sighting.extent_rad)
            measurement.values[:] += (offset_pan, offset_pan, offset_tilt)
            seen = np.array([left_pan + offset_pan, right_pan + offset_pan, seen_tilt + offset_tilt])
        else:
            measurement, (left_pan, seen_tilt) = directions.one_eye(
                self._history, True, sighting.stamp_s, sighting.left_x, sighting.left_y, sigma
            )
            measurement.values[:] += (offset_pan, offset_tilt)
            seen = np.array([left_pan + offset_pan, math.nan, seen_tilt + offset_tilt])
        self._track_seen_s = sighting.stamp_s
        return self._believe(measurement, seen, sighting.skew_s, now_s, "track")

    def see_fovea(self, sighting: FoveaDisparity, now_s: float) -> bool:
        """Take the disparity at the left fovea; True if it was the target's and was believed."""
        if not (sighting.usable and sighting.confidence >= self._p.minimum_confidence):
            self.note = sighting.reason or "no confident disparity at the fovea"
            return False
        if not self.eyes_were_still(sighting.stamp_s, sighting.skew_s) or not self._at_fovea(sighting.stamp_s):
            return False
        sigma = self._sigma(sighting.stamp_s, _positive(sighting.sigma_rad, self._p.direction_sigma_rad))
        measurement = directions.fovea_vergence(
            self._history, sighting.stamp_s, sighting.skew_s, sighting.horizontal_rad, sigma
        )
        vergence = float(measurement.values[0])
        self._compare_with_track(sighting.stamp_s, vergence)
        if sighting.stamp_s - self._track_vergence[0] < _FRESH_S:
            return False  # the tracker measures the target itself; the fovea only whatever lies there
        joints = self._history.shaft_at(sighting.stamp_s)
        seen = np.array([math.nan, joints[0] + vergence, math.nan])
        established = self._track_id is not None or self.class_name is not None
        if established and not self._still_at_its_depth(vergence, sighting.stamp_s, now_s):
            self.note = "something at another depth lies at the fovea"
            return False
        return self._believe(measurement, seen, sighting.skew_s, now_s, "fovea", may_jump=not established)

    def _still_at_its_depth(self, vergence_rad: float, stamp_s: float, now_s: float) -> bool:
        """Tell whether the fovea's vergence may be that of a target that was itself seen: not if something hides it."""
        if now_s - self._target_seen_s < _FRESH_S:
            return True
        estimate = self.estimate(stamp_s)
        return estimate is not None and abs(vergence_rad - estimate.vergence_rad) < _SAME_DEPTH_RAD

    def see_box(self, sighting: BoxSighting, now_s: float) -> bool:
        """Take a detected target; True if it is of the wanted class and was believed."""
        if self.class_name is None or not sighting.usable or self.class_name not in ("", sighting.class_name):
            return False
        if not self.eyes_were_still(sighting.stamp_s, sighting.skew_s):
            return False
        sigma = self._sigma(sighting.stamp_s, _positive(sighting.sigma_rad, self._p.direction_sigma_rad))
        left = (_tangent(sighting.left_azimuth_rad), _tangent(sighting.left_elevation_rad))
        right = (_tangent(sighting.right_azimuth_rad), _tangent(sighting.right_elevation_rad))
        if math.isfinite(left[0]) and math.isfinite(right[0]):
            disparity = sighting.surface_disparity_rad
            right_x = _tangent(sighting.left_azimuth_rad - disparity) if math.isfinite(disparity) else right[0]
            measurement, seen_both = directions.both_eyes(
                self._history, sighting.stamp_s, sighting.skew_s, left, right_x, sigma, 0.0
            )
            seen = np.array(seen_both)
        else:
            in_left = math.isfinite(left[0])
            stamp_s = sighting.stamp_s + (0.0 if in_left else sighting.skew_s)
            measurement, (pan, tilt) = directions.one_eye(
                self._history, in_left, stamp_s, *(left if in_left else right), sigma
            )
            seen = np.array([pan if in_left else math.nan, math.nan if in_left else pan, tilt])
        if not self.filter.initialised:
            self._start_from(measurement)
        return self._believe(measurement, seen, sighting.skew_s, now_s, "box")

    def see_point(self, sighting: PointSighting, now_s: float) -> bool:
        """Take a point of the stream; True if the stream is wanted and the point was believed."""
        if not self.takes_stream:
            return False
        sigma = _positive(sighting.sigma_rad, self._p.point_sigma_rad)
        measurement = directions.point(self._history, sighting.stamp_s, sighting.point_m, self._baseline_m, sigma)
        if not self.filter.initialised:
            self._start_from(measurement)
        version, vergence, tilt = measurement.values
        seen = np.array([version - 0.5 * vergence, version + 0.5 * vergence, tilt])
        return self._believe(measurement, seen, 0.0, now_s, "point")

    def _believe(
        self, measurement: Measurement, seen_rad: Array, skew_s: float, now_s: float, source: str, may_jump: bool = True
    ) -> bool:
        self._loosen_before(measurement.stamp_s)
        if not self.filter.update(measurement, may_jump):
            self.note = (
                f"{source} differs from the prediction by {math.degrees(self.filter.last_innovation_rad):.1f} deg"
            )
            return False
        if source == "fovea":
            # It tells only the depth; where the target lies is what is known of it.
            seen_rad = np.where(np.isnan(seen_rad), self.filter.at(measurement.stamp_s).joints_rad, seen_rad)
        at_left = self._history.shaft_at(measurement.stamp_s)
        at_right = self._history.shaft_at(measurement.stamp_s + skew_s)
        error_rad = seen_rad - np.array([at_left[0], at_right[1], at_left[2]])
        self.visual = VisualError(measurement.stamp_s, seen_rad, error_rad)
        self.seen_s, self.source, self.note = now_s, source, ""
        if source != "fovea":
            self._target_seen_s = now_s
        return True

    def _start_from(self, measurement: Measurement) -> None:
        """Begin the filter at a first sighting, with the vergence that is assumed while only one eye sees."""
        wide = math.radians(60.0)
        joints = self._history.shaft_at(measurement.stamp_s)
        angles = np.array([0.5 * (joints[0] + joints[1]), self._p.prior_vergence_rad, joints[2]])
        sigma = wide if len(measurement.values) > 2 else self._p.prior_vergence_sigma_rad
        self.filter.start(measurement.stamp_s, angles, np.diag(np.square([wide, sigma, wide])))

    def eyes_were_still(self, stamp_s: float, skew_s: float) -> bool:
        """Tell whether the eyes turned slowly enough, and for long enough before, for a pair to be used."""
        if not (math.isfinite(stamp_s) and math.isfinite(skew_s) and abs(skew_s) < 0.1):
            return False
        if not self._history.covers(stamp_s):
            return False
        first, last = min(stamp_s, stamp_s + skew_s), max(stamp_s, stamp_s + skew_s)
        return self._history.speed_within(first - self._p.settle_s, last) < self._p.still_speed_rad_s

    def _sigma(self, stamp_s: float, sigma_rad: float) -> float:
        """Add what a few milliseconds of doubt about the stamps mean while the eyes move."""
        speed = self._history.speed_within(stamp_s - 0.02, stamp_s + 0.001)
        return math.hypot(sigma_rad, _TIMING_SIGMA_S * speed)

    def _at_fovea(self, stamp_s: float) -> bool:
        estimate = self.estimate(stamp_s)
        if estimate is None:
            return False
        joints, target = self._history.shaft_at(stamp_s), estimate.joints_rad
        return math.hypot(target[0] - joints[0], target[2] - joints[2]) <= self._p.fovea_radius_rad

    def _is_wanted_track(self, sighting: TrackSighting, pan: float, tilt: float) -> bool:
        if self.class_name is not None or self.takes_stream:
            return False
        if sighting.track_id == self._track_id:
            return True
        estimate = self.estimate(sighting.stamp_s)
        if estimate is None or sighting.stamp_s < self._wanted_since_s:
            return False
        joints = estimate.joints_rad
        offset = (float(joints[0] - pan), float(joints[2] - tilt))
        distance = math.hypot(*offset)
        if distance > self._p.adopt_radius_rad:
            self.note = f"the tracker follows something {math.degrees(distance):.1f} deg away"
            return False
        vergence_off = self._track_vergence_off(sighting, estimate)
        if abs(vergence_off) > 4.0 * float(estimate.sigmas_rad[1]) + self._p.disagreement_rad:
            self.note = f"the tracker follows something {math.degrees(vergence_off):.1f} deg nearer or farther"
            return False
        # The first lock after a click keeps the click: what was asked for may lie beside the middle of what is tracked,
        # and a tracker that did not lock anew because the move was small still follows its old target next to it.
        first = self._track_id is None
        self._track_offset = offset if first else (0.0, 0.0)
        self._track_id = sighting.track_id
        return True

    def _track_vergence_off(self, sighting: TrackSighting, estimate: TargetEstimate) -> float:
        """Return by how much the track's vergence differs from the target's [rad]; 0 while it has none."""
        if not math.isfinite(sighting.disparity_rad):
            return 0.0
        shaft = self._history.shaft_at(sighting.stamp_s)
        return float(shaft[1] - shaft[0]) + sighting.disparity_rad - estimate.vergence_rad

    def _compare_with_track(self, stamp_s: float, vergence_rad: float) -> None:
        track_s, track_vergence, extent = self._track_vergence
        if abs(track_s - stamp_s) > 1e-6:
            return
        own_depth = abs(vergence_rad) * (extent if math.isfinite(extent) else 0.0)
        if abs(vergence_rad - track_vergence) > self._p.disagreement_rad + own_depth:
            self._disagreeing = min(self._disagreeing + 1, 2 * _DISAGREEING_PAIRS)
        else:
            self._disagreeing = max(self._disagreeing - 2, 0)


def _positive(sigma_rad: float, fallback_rad: float) -> float:
    if not (math.isfinite(sigma_rad) and sigma_rad > 0):
        return fallback_rad
    return min(max(sigma_rad, _SIGMA_BOUNDS_RAD[0]), _SIGMA_BOUNDS_RAD[1])


def _tangent(angle_rad: float) -> float:
    """Return the normalised coordinate of an angle; NaN for one that no lens sees."""
    return math.tan(angle_rad) if abs(angle_rad) < _WIDEST_RAD else math.nan


__all__ = ["SightingError", "TargetTracking"]
