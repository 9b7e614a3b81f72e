"""Data association: which observations are of the requested target, and the measurements they give.

The target is requested once (a click, a point, a class). From then on it is followed by the class-free tracker once
that has locked on it, by boxes of the requested class or around the requested point, or by a stream of points; the
disparity at the left fovea gives the depth of whatever lies there, and counts while the target does. Where boxes and
fovea differ, the boxes' depth is the target's.
"""

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from vergence_gaze.estimation import directions
from vergence_gaze.estimation.consistency_monitor import ConsistencyMonitor
from vergence_gaze.estimation.depth_monitor import DepthMonitor
from vergence_gaze.estimation.directions import SightingError
from vergence_gaze.estimation.distractor_gate import SAME_DEPTH_RAD, DistractorGate
from vergence_gaze.estimation.exposures import Exposures, positive_sigma
from vergence_gaze.estimation.kalman import Measurement
from vergence_gaze.estimation.locks import BoxLock, TrackLock
from vergence_gaze.estimation.observations import BoxSighting, FoveaDisparity, PointSighting, TrackSighting
from vergence_gaze.estimation.target_estimator import TargetEstimator
from vergence_gaze.goals.requested_point import RequestedPoint
from vergence_gaze.joints.joint_moves import JointMoves
from vergence_gaze.joints.shaft_history import ShaftHistory
from vergence_gaze.parameters import GazeParameters
from vergence_rig.geometry import point_at
from vergence_rig.rig import Rig

Array = npt.NDArray[np.float64]

_FRESH_S = 0.15
_BOX_LATE_S = 0.4
_CLASS_CONFIRMED_S = 1.0
_NAMED_DISTANCES = 4
_FARTHEST_RAD = 0.0065  # vergence of 10 m with a baseline of 65 mm
_RESTED_S = 0.05  # an image shows where a move ended once the joints have rested this long


class TargetTracking(TargetEstimator):
    """Decides which observations update the target's estimate."""

    def __init__(self, rig: Rig, parameters: GazeParameters, history: ShaftHistory, moves: JointMoves) -> None:
        super().__init__(parameters, history, moves)
        self._baseline_m = rig.baseline_m
        self._exposures = Exposures(parameters, history)
        self._consistency = ConsistencyMonitor(parameters.target.disagreement_rad)
        self._depths = DepthMonitor()
        self._distractors = DistractorGate(parameters.target.distractor_persistence_s)
        self.clear()

    def clear(self) -> None:
        """Remove the target and the request for it."""
        self.remove_target()
        self.class_name: str | None = None
        self.follows_stream = False
        self._track, self._boxes = TrackLock(), BoxLock()
        self._consistency.clear()
        self._depths.clear()
        self._distractors.clear()
        self._requested_s = self._class_seen_s = -math.inf
        self._fovea_was_inconsistent = False
        self._goal_id = 0
        self._tracker_answers = False
        self.point: RequestedPoint | None = None
        self.ambiguity = ""
        """Which distances the target may have, while several fit."""
        self._history.play.restart()

    def request_target(
        self, now_s: float, stamp_s: float, angles_rad: Array, covariance: Array, goal_id: int = 0
    ) -> None:
        """Start with a target at version, vergence, tilt (3,) with this covariance (3, 3), as seen at `stamp_s`.

        With a `goal_id` the tracker was asked for it: as soon as it answers, only its track for that goal is the
        target, and nothing else that lies near the fovea.
        """
        self.clear()
        self._goal_id = goal_id
        self.filter.initialise(stamp_s, angles_rad, covariance)
        self._requested_s = now_s
        self.seen_s = now_s

    def request_point(self, now_s: float, stamp_s: float, angles_rad: Array, covariance: Array, goal_id: int) -> None:
        """Start with a point in space, as `request_target`: only what the tracker sees there updates it."""
        self.request_target(now_s, stamp_s, angles_rad, covariance, goal_id)
        joints_rad = self.filter.at(stamp_s).joints_rad
        self.point = RequestedPoint(goal_id, joints_rad, self._p.target, self._p.control.no_images_s)

    def request_class(self, now_s: float, class_name: str) -> None:
        """Start with any target of a detected class ("": of any class), wherever it is."""
        self.clear()
        self.class_name = class_name
        self._requested_s = now_s

    def request_stream(self, now_s: float) -> None:
        """Start with the next point of the stream."""
        self.clear()
        self.follows_stream = True
        self._requested_s = now_s

    @property
    def disagreement(self) -> bool:
        """True while two estimators differ by more than the object's own depth explains."""
        return self._consistency.disagreement(self.filter.moving)

    @property
    def differing(self) -> bool:
        """True if estimators have just differed, though not yet for long enough to be a disagreement."""
        return self._consistency.differing

    @property
    def _only_track_counts(self) -> bool:
        """True where the tracker's answer alone shows the target: neither the fovea nor boxes do."""
        return self._tracker_answers or self.point is not None

    def update_track(self, sighting: TrackSighting, now_s: float) -> bool:
        """Update by a track; returns True if it was the target's and was accepted."""
        answers = self._goal_id > 0 and sighting.goal_id == self._goal_id
        if answers:
            self._tracker_answers = True
            if self.point is not None:
                self.point.on_answer()
        if not sighting.usable or not self.eyes_were_still(sighting.stamp_s, sighting.skew_s):
            return False
        sigma = self._exposures.sigma(sighting.stamp_s, sighting.skew_s, self._p.target.direction_sigma_rad)
        disparity_sigma = positive_sigma(sighting.sigma_rad, self._p.target.direction_sigma_rad)
        measurement, seen = directions.track(self._history, sighting, sigma, disparity_sigma)
        if answers:
            self.ambiguity = self._ambiguity_of(sighting) if sighting.ambiguous else ""
        self.inflate_for_joint_motion(sighting.stamp_s)
        self._track.add(sighting.stamp_s, sighting.track_id, seen)
        if not self._is_target_track(sighting, seen):
            return False
        if self.point is not None and (objection := self.point.objection(seen)):
            self.note = f"nothing is seen at the requested point: {objection}"
            return False
        if math.isfinite(seen[1]):
            vergence = float(seen[1] - seen[0])
            own_depth = _own_depth(vergence, sighting.extent_rad)
            self._consistency.update_track(sighting.stamp_s, vergence, own_depth)
            estimate = self.estimate(sighting.stamp_s)
            if estimate is not None and self._depths.is_depth_jump(sighting.stamp_s, vergence, own_depth, estimate):
                # Another object covers part of it: its direction is still valid.
                there = replace(sighting, disparity_rad=math.nan)
                measurement, seen = directions.track(self._history, there, sigma, disparity_sigma)
        measurement, seen = _shifted(measurement, seen, self._track.offset)
        return self.update(measurement, seen, sighting.skew_s, now_s, "track")

    def _ambiguity_of(self, sighting: TrackSighting) -> str:
        """Return the distances that fit, in words, the likeliest first."""
        distances_m = []
        for disparity_rad, _ in sighting.candidates[:_NAMED_DISTANCES]:
            there = replace(sighting, disparity_rad=disparity_rad)
            _, (left_pan, right_pan, tilt) = directions.track(self._history, there, 0.0, 0.0)
            if right_pan - left_pan > _FARTHEST_RAD:
                point_m = point_at(0.5 * (left_pan + right_pan), right_pan - left_pan, tilt, self._baseline_m)
                distances_m.append(f"{np.linalg.norm(point_m):.2f} m")
            else:
                distances_m.append("far away")
        return f"{sighting.reason}: {', '.join(distances_m)}" if len(distances_m) > 1 else sighting.reason

    def _observe_play(self, sighting: TrackSighting, seen_rad: Array) -> None:
        """Learn the joints' play from a target at rest that is seen by eyes at rest."""
        first, last = sorted((sighting.stamp_s, sighting.stamp_s + sighting.skew_s))
        if self.filter.moving or self._history.speed_within(first - _RESTED_S, last) > 0.0:
            return
        at_left, at_right = self._history.shaft_at(sighting.stamp_s), self._history.shaft_at(last)
        axes_rad = np.array([at_left[0], at_right[1], at_left[2]])
        self._history.play.observe(self._history.reported_at(sighting.stamp_s), seen_rad - axes_rad)

    def update_fovea(self, sighting: FoveaDisparity, now_s: float) -> bool:
        """Update by the disparity at the left fovea; returns True if it was the target's and was accepted."""
        if not (sighting.usable and sighting.confidence >= self._p.target.minimum_confidence):
            self.note = sighting.reason or "no confident disparity at the fovea"
            return False
        stamp_s = sighting.stamp_s
        if not self.eyes_were_still(stamp_s, sighting.skew_s) or not self._exposures.at_fovea(
            stamp_s, self.estimate(stamp_s)
        ):
            return False
        sigma = self._exposures.sigma(stamp_s, sighting.skew_s, sighting.sigma_rad)
        measurement = directions.fovea_vergence(self._history, stamp_s, sighting.skew_s, sighting.horizontal_rad, sigma)
        # Between the two exposures the target has moved on in the right eye.
        measurement = replace(
            measurement, values=measurement.values - self.joint_rates_rad_s(stamp_s)[1] * sighting.skew_s
        )
        vergence = float(measurement.values[0])
        joints = self._history.shaft_at(stamp_s)
        self.inflate_for_joint_motion(stamp_s)
        if not self._tracker_answers:
            self._consistency.update_fovea(stamp_s, vergence)
        self._depths.update_fovea(stamp_s, vergence)
        self._distractors.update_fovea(stamp_s, vergence, joints)
        if self._only_track_counts:
            return False  # the fovea sees whatever lies there, the tracker what was asked for
        if self._consistency.track_is_fresh(stamp_s, _FRESH_S) and not self._depths.track_inconsistent:
            return False  # the tracker measures the target itself, the fovea only whatever lies there
        if not self._consistency.accepts_fovea(stamp_s, vergence):
            self.note = "the disparity at the fovea is not of the target that the boxes show"
            return False
        seen = np.array([math.nan, joints[0] + vergence, math.nan])
        established = self._track.track_id is not None or self.class_name is not None or self._boxes.adopted
        if established and not self._at_target_depth(vergence, sigma, stamp_s, now_s):
            self.note = "an object at another depth than the target's lies at the fovea"
            return False
        return self.update(measurement, seen, sighting.skew_s, now_s, "fovea", may_jump=lambda: not established)

    def _at_target_depth(self, vergence_rad: float, sigma_rad: float, stamp_s: float, now_s: float) -> bool:
        """Return whether the fovea's vergence may be that of an identified target: not if something occludes it."""
        estimate = self.estimate(stamp_s)
        if estimate is None:
            return False
        bound_rad = SAME_DEPTH_RAD
        if now_s - self.identified_s < _FRESH_S:
            bound_rad += 2.0 * (sigma_rad + float(estimate.sigmas_rad[1]))
        return abs(vergence_rad - estimate.vergence_rad) < bound_rad

    def update_box(self, sighting: BoxSighting, now_s: float) -> bool:
        """Update by a detection; returns True if it was the target, by its class or its place, and was accepted."""
        by_class = self.class_name is not None
        if self._only_track_counts or not sighting.usable or self.class_name not in (None, "", sighting.class_name):
            return False
        if not (by_class or (sighting.whole and self.filter.initialised)):
            return False
        if not self.eyes_were_still(sighting.stamp_s, sighting.skew_s):
            return False
        sigma = self._exposures.sigma(sighting.stamp_s, sighting.skew_s, sighting.sigma_rad)
        measurement, seen = directions.box(self._history, sighting, sigma)
        self.inflate_for_joint_motion(sighting.stamp_s)
        vergence = float(seen[1] - seen[0])
        own_depth = _own_depth(vergence, sighting.extent_rad)
        as_deep_rad = own_depth + SAME_DEPTH_RAD
        if not by_class:
            if not self._contains_target(sighting, seen, own_depth):
                return False
            self._boxes.correct_offset(seen, self._track.place_at(sighting.stamp_s))
            measurement, seen = _shifted(measurement, seen, self._boxes.offset)
            self._track.correct_offset(sighting.stamp_s, seen)
        elif not self.filter.initialised:
            self.initialise_from(measurement)
        elif not self._track.correct_offset_by_class(sighting.stamp_s, seen, sighting.extent_rad, as_deep_rad):
            self._reject_track()

        def may_jump() -> bool:
            if not by_class:
                return True
            expected = self.filter.at(sighting.stamp_s)
            return self._distractors.accepts(sighting.stamp_s, seen, sighting.extent_rad, own_depth, expected)

        unexpected_rad = abs(vergence - self.filter.at(sighting.stamp_s).vergence_rad)
        accepted = self.update(measurement, seen, sighting.skew_s, now_s, "box", may_jump)
        if accepted:
            there = self.filter.at(sighting.stamp_s)
            self._distractors.on_target(sighting.stamp_s, there)
            if by_class:
                self._class_seen_s = max(sighting.stamp_s, self._class_seen_s)
                self._track.adopt_by_class(sighting.stamp_s, there, seen, sighting.extent_rad, as_deep_rad)
        if accepted or not by_class:
            self._consistency.update_box(sighting.stamp_s, vergence, math.sqrt(2.0) * sigma, own_depth)
            self._apply_box_verdict(sighting.stamp_s, unexpected_rad)
        return accepted

    def _contains_target(self, sighting: BoxSighting, seen_rad: Array, own_depth_rad: float) -> bool:
        """Return whether boxes contain the requested point. They may correct the fovea, but not a certain tracker."""
        estimate = self.estimate(sighting.stamp_s)
        if estimate is None:
            return False
        bound = math.inf
        if self._consistency.track_is_fresh(sighting.stamp_s, _BOX_LATE_S) and not self.differing:
            bound = self._p.target.disagreement_rad + own_depth_rad + 4.0 * float(estimate.sigmas_rad[1])
        return self._boxes.adopt(seen_rad, sighting.extent_rad, bound, estimate)

    def _apply_box_verdict(self, stamp_s: float, unexpected_rad: float) -> None:
        """Release what, by the boxes, is not the target; their depth was `unexpected_rad` off the estimate."""
        inconsistent = self._consistency.fovea_inconsistent(stamp_s)
        # Wrong depths are in the estimate: inflated, it can follow the boxes.
        off_rad = self._consistency.fovea_off_rad if inconsistent and not self._fovea_was_inconsistent else 0.0
        if self._track.track_id is not None and self._consistency.track_inconsistent(stamp_s) and not inconsistent:
            off_rad = self._consistency.track_off_rad
            self._reject_track()
        if off_rad and math.isfinite(unexpected_rad):
            self.filter.inflate_covariance(np.array([0.5, 0.5, 0.0]) * min(abs(off_rad), unexpected_rad) ** 2)
        self._fovea_was_inconsistent = inconsistent

    def _reject_track(self) -> None:
        self._track.reject()
        self._consistency.drop_track()

    def update_point(self, sighting: PointSighting, now_s: float) -> bool:
        """Update by a point of the stream; returns True if the stream is followed and the point was accepted."""
        if not self.follows_stream:
            return False
        sigma = positive_sigma(sighting.sigma_rad, self._p.target.point_sigma_rad)
        measurement = directions.point(self._history, sighting.stamp_s, sighting.point_m, self._baseline_m, sigma)
        if not self.filter.initialised:
            self.initialise_from(measurement)
        version, vergence, tilt = measurement.values
        seen = np.array([version - 0.5 * vergence, version + 0.5 * vergence, tilt])
        return self.update(measurement, seen, 0.0, now_s, "point")

    def eyes_were_still(self, stamp_s: float, skew_s: float) -> bool:
        """Return whether the eyes turned slowly enough, and for long enough before, for a pair to be used."""
        target = self.estimate(stamp_s) if math.isfinite(stamp_s) else None
        return self._exposures.were_still(stamp_s, skew_s, target)

    def _is_target_track(self, sighting: TrackSighting, seen_rad: Array) -> bool:
        if self.follows_stream or (self.point is not None and not self._tracker_answers):
            return False
        if self._tracker_answers:
            self.note = self._track.adopt_requested(sighting.track_id, sighting.goal_id == self._goal_id)
            if not self.note:
                self._observe_play(sighting, seen_rad)
            return not self.note
        same = sighting.track_id == self._track.track_id
        if self.class_name is not None:
            # The tracker has no classes: it counts for as long as boxes confirm that it follows the requested one.
            if not same:
                self._consistency.drop_track()
            return same and abs(sighting.stamp_s - self._class_seen_s) < _CLASS_CONFIRMED_S
        if same:
            return True
        estimate = self.estimate(sighting.stamp_s)
        if estimate is None or sighting.stamp_s < self._requested_s:
            return False
        # A track of unknown depth is the target only where the eye looked when it was locked on.
        known = math.isfinite(seen_rad[1])
        radius_rad = (
            self._p.target.track_radius_rad
            if known
            else min(self._p.target.track_radius_rad, self._p.target.fovea_radius_rad)
        )
        why_not = self._track.adopt(sighting.track_id, seen_rad, estimate, radius_rad, self._p.target.disagreement_rad)
        self.note = why_not or self.note
        return not why_not


def _shifted(measurement: Measurement, seen_rad: Array, offset_rad: Array) -> tuple[Measurement, Array]:
    """Return measurement and place (3,) of the point at an offset (2,) in pan and tilt from what was measured."""
    pan, tilt = (float(angle) for angle in offset_rad)
    return directions.shifted(measurement, pan, tilt), seen_rad + np.array([pan, pan, tilt])


def _own_depth(vergence_rad: float, extent_rad: float) -> float:
    """Return by how much vergence may differ over an object that is as deep as wide."""
    return abs(vergence_rad) * extent_rad if math.isfinite(extent_rad * vergence_rad) else 0.0


__all__ = ["SightingError", "TargetTracking"]
