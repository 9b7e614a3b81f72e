"""Which sightings are of the wanted target, and what they say of it: the way from observations into the filter.

The wanted target is given once (a click, a point, a class). From then on it is followed by the class-free tracker once
that has locked on it, by boxes of the wanted class or around what was asked for, or by a stream of points; the
disparity at the left fovea gives the depth of whatever lies there, and counts while the target does. Where boxes and
fovea differ, the boxes' depth is the target's.
"""

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from vergence_gaze.estimation import directions
from vergence_gaze.estimation.consistency_monitor import Agreement
from vergence_gaze.estimation.depth_monitor import DepthWatch
from vergence_gaze.estimation.directions import SightingError
from vergence_gaze.estimation.distractor_gate import SAME_DEPTH_RAD, Rivals
from vergence_gaze.estimation.exposures import Exposures, positive_sigma
from vergence_gaze.estimation.kalman import Measurement
from vergence_gaze.estimation.locks import BoxLock, TrackLock
from vergence_gaze.estimation.observations import BoxSighting, FoveaDisparity, PointSighting, TrackSighting
from vergence_gaze.estimation.target_estimator import BelievedTarget
from vergence_gaze.joints.joint_history import JointHistory
from vergence_gaze.joints.joint_moves import JointMoves
from vergence_gaze.parameters import GazeParameters
from vergence_rig.rig import Rig

Array = npt.NDArray[np.float64]

_FRESH_S = 0.15
_BOX_LATE_S = 0.4
_VOUCHED_S = 1.0


class TargetTracking(BelievedTarget):
    """Decides what is believed of the target."""

    def __init__(self, rig: Rig, parameters: GazeParameters, history: JointHistory, moves: JointMoves) -> None:
        super().__init__(parameters, history, moves)
        self._baseline_m = rig.baseline_m
        self._exposures = Exposures(parameters, history)
        self._agreement = Agreement(parameters.disagreement_rad)
        self._depths = DepthWatch()
        self._rivals = Rivals(parameters.distractor_patience_s)
        self.clear()

    def clear(self) -> None:
        """No target is wanted."""
        self.forget()
        self.class_name: str | None = None
        self.takes_stream = False
        self._track, self._boxes = TrackLock(), BoxLock()
        self._agreement.clear()
        self._depths.clear()
        self._rivals.clear()
        self._wanted_since_s = self._class_seen_s = -math.inf
        self._fovea_was_astray = False

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
        return self._agreement.disagreement(self.filter.moving)

    @property
    def doubtful(self) -> bool:
        """True if estimators have just differed, though not for long enough to call it a disagreement."""
        return self._agreement.doubtful

    def see_track(self, sighting: TrackSighting, now_s: float) -> bool:
        """Take a track; True if it was the target's and was believed."""
        if not sighting.usable or not self.eyes_were_still(sighting.stamp_s, sighting.skew_s):
            return False
        sigma = self._exposures.sigma(sighting.stamp_s, sighting.skew_s, self._p.direction_sigma_rad)
        disparity_sigma = positive_sigma(sighting.sigma_rad, self._p.direction_sigma_rad)
        measurement, seen = directions.track(self._history, sighting, sigma, disparity_sigma)
        self.heed_moves(sighting.stamp_s)
        self._track.take(sighting.stamp_s, sighting.track_id, seen)
        if not self._is_wanted_track(sighting, seen):
            return False
        if math.isfinite(seen[1]):
            vergence = float(seen[1] - seen[0])
            own_depth = _own_depth(vergence, sighting.extent_rad)
            self._agreement.see_track(sighting.stamp_s, vergence, own_depth)
            estimate = self.estimate(sighting.stamp_s)
            if estimate is not None and self._depths.is_sudden(sighting.stamp_s, vergence, own_depth, estimate):
                # Something else covers part of it: where it is can still be told.
                there = replace(sighting, disparity_rad=math.nan)
                measurement, seen = directions.track(self._history, there, sigma, disparity_sigma)
        measurement, seen = _beside(measurement, seen, self._track.offset)
        return self.believe(measurement, seen, sighting.skew_s, now_s, "track")

    def see_fovea(self, sighting: FoveaDisparity, now_s: float) -> bool:
        """Take the disparity at the left fovea; True if it was the target's and was believed."""
        if not (sighting.usable and sighting.confidence >= self._p.minimum_confidence):
            self.note = sighting.reason or "no confident disparity at the fovea"
            return False
        stamp_s = sighting.stamp_s
        if not self.eyes_were_still(stamp_s, sighting.skew_s) or not self._exposures.at_fovea(
            stamp_s, self.estimate(stamp_s)
        ):
            return False
        sigma = self._exposures.sigma(stamp_s, sighting.skew_s, sighting.sigma_rad)
        measurement = directions.fovea_vergence(self._history, stamp_s, sighting.skew_s, sighting.horizontal_rad, sigma)
        # Between the two exposures the target has moved on before the right eye.
        measurement = replace(
            measurement, values=measurement.values - self.joint_rates_rad_s(stamp_s)[1] * sighting.skew_s
        )
        vergence = float(measurement.values[0])
        joints = self._history.shaft_at(stamp_s)
        self.heed_moves(stamp_s)
        self._agreement.see_fovea(stamp_s, vergence)
        self._depths.see_fovea(stamp_s, vergence)
        self._rivals.see_fovea(stamp_s, vergence, joints)
        if self._agreement.track_is_fresh(stamp_s, _FRESH_S) and not self._depths.doubts_the_track:
            return False  # the tracker measures the target itself; the fovea only whatever lies there
        if not self._agreement.fovea_may_be_the_target(stamp_s, vergence):
            self.note = "the fovea looks past the target that the boxes show"
            return False
        seen = np.array([math.nan, joints[0] + vergence, math.nan])
        established = self._track.track_id is not None or self.class_name is not None or self._boxes.adopted
        if established and not self._still_at_its_depth(vergence, sigma, stamp_s, now_s):
            self.note = "something at another depth lies at the fovea"
            return False
        return self.believe(measurement, seen, sighting.skew_s, now_s, "fovea", may_jump=lambda: not established)

    def _still_at_its_depth(self, vergence_rad: float, sigma_rad: float, stamp_s: float, now_s: float) -> bool:
        """Tell whether the fovea's vergence may be that of a target that was itself seen: not if something hides it."""
        estimate = self.estimate(stamp_s)
        if estimate is None:
            return False
        bound_rad = SAME_DEPTH_RAD
        if now_s - self.target_itself_seen_s < _FRESH_S:
            bound_rad += 2.0 * (sigma_rad + float(estimate.sigmas_rad[1]))
        return abs(vergence_rad - estimate.vergence_rad) < bound_rad

    def see_box(self, sighting: BoxSighting, now_s: float) -> bool:
        """Take a detected target; True if it is what is wanted, by its class or by its place, and was believed."""
        by_class = self.class_name is not None
        if not sighting.usable or self.class_name not in (None, "", sighting.class_name):
            return False
        if not (by_class or (sighting.whole and self.filter.initialised)):
            return False
        if not self.eyes_were_still(sighting.stamp_s, sighting.skew_s):
            return False
        sigma = self._exposures.sigma(sighting.stamp_s, sighting.skew_s, sighting.sigma_rad)
        measurement, seen = directions.box(self._history, sighting, sigma)
        self.heed_moves(sighting.stamp_s)
        vergence = float(seen[1] - seen[0])
        own_depth = _own_depth(vergence, sighting.extent_rad)
        as_deep_rad = own_depth + SAME_DEPTH_RAD
        if not by_class:
            if not self._contains_target(sighting, seen, own_depth):
                return False
            self._boxes.hold_against(seen, self._track.place_at(sighting.stamp_s))
            measurement, seen = _beside(measurement, seen, self._boxes.offset)
            self._track.hold_against(sighting.stamp_s, seen)
        elif not self.filter.initialised:
            self.start_from(measurement)
        elif not self._track.hold_against_class(sighting.stamp_s, seen, sighting.extent_rad, as_deep_rad):
            self._refuse_track()

        def may_jump() -> bool:
            if not by_class:
                return True
            expected = self.filter.at(sighting.stamp_s)
            return self._rivals.may_be_the_target(sighting.stamp_s, seen, sighting.extent_rad, own_depth, expected)

        unexpected_rad = abs(vergence - self.filter.at(sighting.stamp_s).vergence_rad)
        believed = self.believe(measurement, seen, sighting.skew_s, now_s, "box", may_jump)
        if believed:
            there = self.filter.at(sighting.stamp_s)
            self._rivals.found(sighting.stamp_s, there)
            if by_class:
                self._class_seen_s = max(sighting.stamp_s, self._class_seen_s)
                self._track.adopt_by_class(sighting.stamp_s, there, seen, sighting.extent_rad, as_deep_rad)
        if believed or not by_class:
            self._agreement.see_box(sighting.stamp_s, vergence, math.sqrt(2.0) * sigma, own_depth)
            self._heed_boxes(sighting.stamp_s, unexpected_rad)
        return believed

    def _contains_target(self, sighting: BoxSighting, seen_rad: Array, own_depth_rad: float) -> bool:
        """Tell whether boxes are around what was asked for. They may correct the fovea, but not a sure tracker."""
        estimate = self.estimate(sighting.stamp_s)
        if estimate is None:
            return False
        bound = math.inf
        if self._agreement.track_is_fresh(sighting.stamp_s, _BOX_LATE_S) and not self.doubtful:
            bound = self._p.disagreement_rad + own_depth_rad + 4.0 * float(estimate.sigmas_rad[1])
        return self._boxes.adopt(seen_rad, sighting.extent_rad, bound, estimate)

    def _heed_boxes(self, stamp_s: float, unexpected_rad: float) -> None:
        """Let go of what the boxes, whose depth differs so far from the estimate's, say is not the target."""
        astray = self._agreement.fovea_is_astray(stamp_s)
        # What they told before is in the estimate: the boxes may now move it.
        off_rad = self._agreement.fovea_off_rad if astray and not self._fovea_was_astray else 0.0
        if self._track.track_id is not None and self._agreement.track_is_astray(stamp_s) and not astray:
            off_rad = self._agreement.track_off_rad
            self._refuse_track()
        if off_rad and math.isfinite(unexpected_rad):
            self.filter.loosen(np.array([0.5, 0.5, 0.0]) * min(abs(off_rad), unexpected_rad) ** 2)
        self._fovea_was_astray = astray

    def _refuse_track(self) -> None:
        self._track.refuse()
        self._agreement.drop_track()

    def see_point(self, sighting: PointSighting, now_s: float) -> bool:
        """Take a point of the stream; True if the stream is wanted and the point was believed."""
        if not self.takes_stream:
            return False
        sigma = positive_sigma(sighting.sigma_rad, self._p.point_sigma_rad)
        measurement = directions.point(self._history, sighting.stamp_s, sighting.point_m, self._baseline_m, sigma)
        if not self.filter.initialised:
            self.start_from(measurement)
        version, vergence, tilt = measurement.values
        seen = np.array([version - 0.5 * vergence, version + 0.5 * vergence, tilt])
        return self.believe(measurement, seen, 0.0, now_s, "point")

    def eyes_were_still(self, stamp_s: float, skew_s: float) -> bool:
        """Tell whether the eyes turned slowly enough, and for long enough before, for a pair to be used."""
        target = self.estimate(stamp_s) if math.isfinite(stamp_s) else None
        return self._exposures.were_still(stamp_s, skew_s, target)

    def _is_wanted_track(self, sighting: TrackSighting, seen_rad: Array) -> bool:
        if self.takes_stream:
            return False
        same = sighting.track_id == self._track.track_id
        if self.class_name is not None:
            # The tracker knows no classes: it is believed for as long as boxes say that it follows what is wanted.
            if not same:
                self._agreement.drop_track()
            return same and abs(sighting.stamp_s - self._class_seen_s) < _VOUCHED_S
        if same:
            return True
        estimate = self.estimate(sighting.stamp_s)
        if estimate is None or sighting.stamp_s < self._wanted_since_s:
            return False
        # Of unknown depth it is the target only where the eye looked when it was locked on.
        known = math.isfinite(seen_rad[1])
        radius_rad = self._p.adopt_radius_rad if known else min(self._p.adopt_radius_rad, self._p.fovea_radius_rad)
        why_not = self._track.adopt(sighting.track_id, seen_rad, estimate, radius_rad, self._p.disagreement_rad)
        self.note = why_not or self.note
        return not why_not


def _beside(measurement: Measurement, seen_rad: Array, offset_rad: Array) -> tuple[Measurement, Array]:
    """Return measurement and place (3,) of what lies beside the thing that was seen, by pan and tilt (2,)."""
    pan, tilt = (float(angle) for angle in offset_rad)
    return directions.shifted(measurement, pan, tilt), seen_rad + np.array([pan, pan, tilt])


def _own_depth(vergence_rad: float, extent_rad: float) -> float:
    """Return by how much vergence may differ over an object that is as deep as wide."""
    return abs(vergence_rad) * extent_rad if math.isfinite(extent_rad * vergence_rad) else 0.0


__all__ = ["SightingError", "TargetTracking"]
