"""Data association: what was requested, the gates that its sightings pass, and the measurements that they give.

The target is requested once: a point of an image, a point in space, a class, or a stream of points. The tracker of
edge_metric_node is asked for it, and its answer for that goal is the target. A class is found by its boxes, and
followed by the tracker that was asked for what they show. See gates.py for why a sighting is refused.
"""

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from vergence_gaze.estimation.directions import Directions, SightingError, shifted, without_depth
from vergence_gaze.estimation.exposures import Exposures, positive_sigma
from vergence_gaze.estimation.gates import (
    ClassGate,
    Gate,
    JumpGate,
    MeasuredGate,
    NewerGate,
    PointGate,
    RequestGate,
    Sighting,
    StillGate,
)
from vergence_gaze.estimation.kalman import Measurement
from vergence_gaze.estimation.observations import BoxSighting, PointSighting, TrackSighting
from vergence_gaze.estimation.target_estimate import joints_of
from vergence_gaze.estimation.target_estimator import TargetEstimator
from vergence_gaze.goals.goal import TrackRequest
from vergence_gaze.goals.requested_class import RequestedClass
from vergence_gaze.goals.requested_point import RequestedPoint
from vergence_gaze.joints.joint_moves import JointMoves
from vergence_gaze.joints.shaft_history import ShaftHistory
from vergence_gaze.parameters import GazeParameters
from vergence_rig.geometry import GeometryError
from vergence_rig.kinematics import Kinematics

Array = npt.NDArray[np.float64]

_NAMED_DISTANCES = 4
_FARTHEST_M = 10.0
_LEARNT_RAD = 0.001  # change of half a joint's play from which the target's estimate starts anew
_RESTED_S = 0.05  # an image shows where a move ended once the joints have rested this long


class TargetTracking(TargetEstimator):
    """Keeps the request, and updates the target's estimate by the observations that pass its gates."""

    def __init__(
        self, kinematics: Kinematics, parameters: GazeParameters, history: ShaftHistory, moves: JointMoves
    ) -> None:
        super().__init__(parameters, history, moves)
        self._kinematics, self._directions = kinematics, Directions(kinematics, history)
        self._exposures = Exposures(parameters, history)
        self.clear()

    def clear(self) -> None:
        """Remove the target and the request for it."""
        self._start(RequestGate())

    def _start(
        self,
        asked: RequestGate,
        point: RequestedPoint | None = None,
        by_class: RequestedClass | None = None,
        motion: bool = False,
    ) -> None:
        """Remove the target, and pass sightings through the gates of what is asked for from now on."""
        self.remove_target()
        self.point, self._class, self._asked, self._motion = point, by_class, asked, motion
        self.object_id = 0
        """The detected object that is the target; 0 while none is."""
        self.ambiguity = ""
        """Which distances the target may have, while several fit."""
        self._request: TrackRequest | None = None
        self._history.play.restart()
        self._newer, self._class_gate = NewerGate(), ClassGate(self._p.target)
        seen: list[Gate] = [asked, MeasuredGate(), StillGate(self._exposures)]
        of_class: list[Gate] = [self._class_gate] if by_class is not None else []
        at_point: list[Gate] = [PointGate(point)] if point is not None else []
        jump = JumpGate(self._p.target)
        self._gates: dict[str, list[Gate]] = {
            "track": [*seen, *at_point, *of_class, jump],
            "box": [*seen, *of_class, jump, self._newer],
            "point": [asked],
        }

    @property
    def class_name(self) -> str | None:
        """The requested class ("": any), None while no class is requested."""
        return self._asked.class_name

    @property
    def awaits_motion(self) -> bool:
        """True while nothing has moved since it was asked for."""
        return self._motion and not self.filter.initialised

    @property
    def follows_stream(self) -> bool:
        """True while the target is a stream of points."""
        return self._asked.stream

    def request_target(self, now_s: float, stamp_s: float, angles_rad: Array, covariance: Array, goal_id: int) -> None:
        """Start with a target at version, vergence, tilt (3,) with this covariance (3, 3), as seen at `stamp_s`.

        Only the tracker's answer for this goal is the target, and nothing else that lies near the fovea.
        """
        self._start(RequestGate(goal_id))
        self._expect(now_s, stamp_s, angles_rad, covariance)

    def request_point(self, now_s: float, stamp_s: float, angles_rad: Array, covariance: Array, goal_id: int) -> None:
        """Start with a point in space, as `request_target`: only what the tracker sees there updates it."""
        answer_within_s = self._p.control.no_images_s
        point = RequestedPoint(goal_id, joints_of(angles_rad), self._kinematics, self._p.target, answer_within_s)
        self._start(RequestGate(goal_id), point=point)
        self._expect(now_s, stamp_s, angles_rad, covariance)

    def _expect(self, now_s: float, stamp_s: float, angles_rad: Array, covariance: Array) -> None:
        self.filter.initialise(stamp_s, angles_rad, covariance)
        self.seen_s = now_s

    def request_class(self, class_name: str, goal_id: int, object_id: int = 0) -> None:
        """Start with a target of a detected class ("": of any class), wherever it is; with an id this object alone."""
        by_class = RequestedClass(goal_id, self._p.target.lost_after_s)
        self._start(RequestGate(goal_id, class_name, object_id), by_class=by_class)

    def is_another(self, box: BoxSighting) -> bool:
        """Return whether the detector has chosen another object of the requested class as the target than before."""
        known = self.object_id and box.object_id and box.object_id != self.object_id
        return bool(
            known and box.usable and self._asked.class_name in ("", box.class_name) and not self._asked.object_id
        )

    def request_motion(self, goal_id: int) -> None:
        """Start with whatever moves next, as the tracker answers for this goal."""
        self._start(RequestGate(goal_id), motion=True)

    def request_stream(self) -> None:
        """Start with the next point of the stream."""
        self._start(RequestGate(stream=True))

    def pop_track_request(self) -> TrackRequest | None:
        """Return and remove what the tracker is to be asked for a class."""
        request, self._request = self._request, None
        return request

    def update_track(self, track: TrackSighting, now_s: float) -> bool:
        """Update by a track; returns True if it was the target's and was accepted."""
        if track.goal_id == self._asked.goal_id > 0 and self.point is not None:
            self.point.on_answer()

        def locate() -> tuple[Measurement, Array]:
            sigma = self._exposures.sigma(track.stamp_s, track.skew_s, self._p.target.direction_sigma_rad)
            disparity_sigma = positive_sigma(track.sigma_rad, self._p.target.direction_sigma_rad)
            # Boxes of a class tell the distance that the tracker alone is not sure of.
            unsure = track.ambiguous and self._class is not None
            shown = replace(track, disparity_rad=math.nan) if unsure else track
            return self._directions.track(shown, sigma, disparity_sigma, self._assumed_vergence_rad(track.stamp_s))

        sighting = Sighting("track", track, locate, track.skew_s, track.extent_rad)
        accepted = self._consider(sighting, now_s)
        if accepted:
            self.ambiguity = self._ambiguity_of(track) if track.ambiguous and self._class is None else ""
        return accepted

    def update_box(self, box: BoxSighting, now_s: float) -> bool:
        """Update by a detection; returns True if it is of the requested class and was accepted."""

        def locate() -> tuple[Measurement, Array]:
            sigma = self._exposures.sigma(box.stamp_s, box.skew_s, box.sigma_rad)
            rate_rad_s = float(self.joint_rates_rad_s(box.stamp_s)[1])
            return self._directions.box(box, sigma, rate_rad_s, self._assumed_vergence_rad(box.stamp_s))

        accepted = self._consider(Sighting("box", box, locate, box.skew_s, box.extent_rad), now_s)
        if accepted:
            self.object_id = box.object_id
        if accepted and self._class is not None:
            request = self._class.request(box, now_s)
            if request is not None:
                self._request = request
                self._class_gate.restart(box.stamp_s)
        return accepted

    def update_point(self, point: PointSighting, now_s: float) -> bool:
        """Update by a point of the stream; returns True if the stream is followed and the point was accepted."""

        def locate() -> tuple[Measurement, Array]:
            sigma = positive_sigma(point.sigma_rad, self._p.target.point_sigma_rad)
            measurement = self._directions.point(point.stamp_s, point.point_m, sigma)
            return measurement, joints_of(measurement.values)

        return self._consider(Sighting("point", point, locate), now_s)

    def eyes_were_still(self, stamp_s: float, skew_s: float) -> bool:
        """Return whether the eyes turned slowly enough, and for long enough before, for a pair to be used."""
        target = self.estimate(stamp_s) if math.isfinite(stamp_s) else None
        return self._exposures.were_still(stamp_s, skew_s, target)

    def _consider(self, sighting: Sighting, now_s: float) -> bool:
        """Pass a sighting through the gates of its source and update the target by it; False if it was refused."""
        self.inflate_for_joint_motion(sighting.stamp_s)
        estimate, direction_only = self.estimate(sighting.stamp_s), False
        for gate in self._gates[sighting.source]:
            verdict = gate.check(sighting, estimate)
            if not verdict.accepted:
                self.note = verdict.reason or self.note
                return False
            direction_only |= verdict.direction_only
        measurement, seen_rad = sighting.located
        if self._class is not None and sighting.source == "track":
            measurement, seen_rad = shifted(measurement, seen_rad, self._class_gate.beside_rad)
        if direction_only:
            measurement, seen_rad = without_depth(measurement, seen_rad)
        if sighting.source == "track" and self._class is None:
            learnt = self._observe_play(sighting.stamp_s, sighting.skew_s, seen_rad)
            if learnt and np.isfinite(seen_rad).all():
                # Until now the target seemed to move by what the joints did not.
                measurement, seen_rad = sighting.locate()
                self.initialise_from(measurement)
        if not self.filter.initialised:
            self.initialise_from(measurement)
        accepted = self.update(measurement, seen_rad, sighting.skew_s, now_s, sighting.source)
        if accepted and sighting.source == "track" and np.isfinite(seen_rad).all():
            self._newer.tracked_s = max(self._newer.tracked_s, sighting.stamp_s)
        return accepted

    def _assumed_vergence_rad(self, stamp_s: float) -> float:
        """Return the vergence that a target seen by one eye is taken to have."""
        estimate = self.estimate(stamp_s) if math.isfinite(stamp_s) else None
        return self._p.target.prior_vergence_rad if estimate is None else estimate.vergence_rad

    def _ambiguity_of(self, track: TrackSighting) -> str:
        """Return the distances that fit, in words, the likeliest first."""
        distances_m = []
        for disparity_rad, _ in track.candidates[:_NAMED_DISTANCES]:
            there = replace(track, disparity_rad=disparity_rad)
            _, (left_pan, right_pan, tilt) = self._directions.track(there, 0.0, 0.0, math.nan)
            try:
                place = self._kinematics.point_at(0.5 * (left_pan + right_pan), right_pan - left_pan, tilt)
                distance_m = float(np.linalg.norm(place))
            except GeometryError:
                distance_m = math.inf
            distances_m.append(f"{distance_m:.2f} m" if distance_m < _FARTHEST_M else "far away")
        return f"{track.reason}: {', '.join(distances_m)}" if len(distances_m) > 1 else track.reason

    def _observe_play(self, stamp_s: float, skew_s: float, seen_rad: Array) -> bool:
        """Learn the joints' play from a target that eyes at rest have just seen at these angles (3,).

        Returns whether it is now another than the target's estimate was made with.
        """
        first, last = sorted((stamp_s, stamp_s + skew_s))
        if self._history.speed_within(first - _RESTED_S, last) > 0.0:
            return False
        at_left, at_right = self._history.shaft_at(stamp_s), self._history.shaft_at(last)
        axes_rad, before_rad = np.array([at_left[0], at_right[1], at_left[2]]), self._history.half_play_rad
        self._history.play.observe(stamp_s, seen_rad - axes_rad)
        now_rad = self._history.half_play_rad
        return now_rad is not before_rad and bool(np.abs(now_rad - before_rad).max() > _LEARNT_RAD)


__all__ = ["SightingError", "TargetTracking"]
