"""What the controller knows: observations in, joints, target and verdict out. It commands nothing."""

import math

import numpy as np
import numpy.typing as npt

from vergence_gaze.control.judge import VergedJudge
from vergence_gaze.estimation.distance import UNKNOWN, TargetPosition, joint_variances, target_position
from vergence_gaze.estimation.evidence import Belief, doubt
from vergence_gaze.estimation.observations import (
    BoxSighting,
    EdgeJudgement,
    EyeRotationReading,
    FoveaDisparity,
    JointReport,
    Observation,
    PointSighting,
    TrackSighting,
)
from vergence_gaze.estimation.target_filter import TargetEstimate
from vergence_gaze.estimation.tracking import SightingError, TargetTracking
from vergence_gaze.estimation.vergence_offset import VergenceOffset, farthest_offset_rad
from vergence_gaze.joints.joint_history import JointHistory
from vergence_gaze.joints.joint_moves import JointMoves
from vergence_gaze.joints.resolution import pulse_steps_rad
from vergence_gaze.laws import Contrast, Law
from vergence_gaze.parameters import GazeParameters
from vergence_rig.rig import Rig

Array = npt.NDArray[np.float64]
Driven = npt.NDArray[np.bool_]

LATEST_FUTURE_S = 1.0
_STEADY_VERGENCE_RAD = 0.005
_SWEEPING_RAD_S = 0.6
_STILL_SPEED_RAD_S = 0.2
_ARRIVED_RAD = 0.004
_COMMANDED_AHEAD_S = 0.03
_DOUBT_OF_MOTION = 0.3
_PLACE_KNOWN_S = 1.0
_NOTHING_KNOWN = Belief(0.0, math.inf)


class Perception:
    """The joints' history, the target's tracking, the judge, and what the visual encoder has told."""

    def __init__(self, rig: Rig, parameters: GazeParameters, driven: Driven) -> None:
        self._rig, self._described_steps_rad = rig, pulse_steps_rad(rig)
        self.history = JointHistory(rig)
        self.image_s = -math.inf
        self.pair_s = math.nan
        self.contrast: Contrast | None = None
        self._foretold, self._foretold_s = _NOTHING_KNOWN, math.nan
        self._set_servos(rig)
        self.set(parameters, driven)

    def set(self, parameters: GazeParameters, driven: Driven) -> None:
        """Begin anew under other parameters; `driven` (3,) says which joints may move."""
        self._p, self._driven = parameters, driven
        self._moves = JointMoves(self._rig, self.history)
        self.tracking = TargetTracking(self._rig, parameters, self.history, self._moves)
        self.judge = VergedJudge(parameters)
        self.judge.unresolved_rad, self.judge.dead_band_rad = self._unresolved_rad, self._dead_band_rad

    def set_rig(self, rig: Rig) -> None:
        """Take a rig whose servos have other steps; target and goal stay."""
        self._set_servos(rig)
        self._moves.steps_rad = pulse_steps_rad(rig)
        self.judge.unresolved_rad, self.judge.dead_band_rad = self._unresolved_rad, self._dead_band_rad

    def _set_servos(self, rig: Rig) -> None:
        self._rig = rig
        self._shaft_variances = joint_variances(rig)
        self.vergence_offset = VergenceOffset(self._shaft_variances, farthest_offset_rad(rig))
        self._dead_band_rad = max(joint.servo.dead_band_rad for _, joint in rig.joints.items())
        coarser = np.maximum(pulse_steps_rad(rig) - self._described_steps_rad, 0.0)
        self._unresolved_rad = 0.5 * float(coarser[0] + coarser[1])

    def forget(self) -> None:
        """The clock was set back: no stamp means anything any more."""
        self.history.forget()
        self.image_s, self.contrast = -math.inf, None

    def take(self, observation: Observation, now_s: float, law: Law, verging: bool) -> None:
        """Take one observation; `verging` tells whether the eyes may now be called verged."""
        if isinstance(observation, JointReport):
            if self.history.add(observation.stamp_s, observation.positions_rad) and self._moves.note():
                self.vergence_offset.moved(observation.stamp_s)
            return
        if not self.history.known or not observation.stamp_s <= now_s + LATEST_FUTURE_S:
            return
        if isinstance(observation, EyeRotationReading):
            self._see_rotation(observation)
            return
        if not isinstance(observation, PointSighting):
            self.image_s = now_s
        if isinstance(observation, EdgeJudgement):
            self._see_contrast(observation, now_s, law, verging)
            return
        self._foretell(observation.stamp_s)
        try:
            believed = self._see(observation, now_s)
        except SightingError as error:
            self.tracking.note = str(error)
            return
        if believed:
            self.pair_s = observation.stamp_s
            if not law.unsigned:
                self._judge_pair(observation.stamp_s, now_s, verging)

    def estimate(self, time_s: float) -> TargetEstimate | None:
        """Return the target at `time_s`, or None."""
        return self.tracking.estimate(time_s)

    def position(self, estimate: TargetEstimate | None) -> TargetPosition:
        """Return where the target is, and how sure that is."""
        if estimate is None:
            return UNKNOWN
        return target_position(estimate, self._rig, self._shaft_variances, self.vergence_offset)

    def unseen_s(self, now_s: float) -> float:
        """Return for how long images came in which the target was not seen; inf before it ever was.

        While no image results come at all there is nothing to be lost in: a starved graph is late, not blind.
        """
        seen_s = self.tracking.seen_s
        if not math.isfinite(seen_s):
            return math.inf
        images_come = now_s - self.image_s < self._p.no_images_s
        return max(0.0, (self.image_s if images_come else now_s) - seen_s)

    def eyes_still(self, now_s: float, command_rad: Array, at_rest: bool = False) -> bool:
        """Tell whether the joints rest where they were commanded (3,), or go along with the target unless `at_rest`."""
        along = np.zeros(3) if at_rest else self.tracking.joint_rates_rad_s(now_s)
        slow = self.history.speed_within(self.history.newest_s - 0.015, now_s, along) < _STILL_SPEED_RAD_S
        return slow and self.off_rad(command_rad) < _ARRIVED_RAD + _COMMANDED_AHEAD_S * float(np.abs(along).max())

    def at(self, joints_rad: Array) -> bool:
        """Tell whether the joints are reported at these angles (3,); NaN asks nothing of its joint."""
        return self.off_rad(joints_rad) < _ARRIVED_RAD

    def off_rad(self, joints_rad: Array) -> float:
        """Return how far the farthest joint is reported from these angles (3,) [rad], NaN left out."""
        off = np.abs(self.history.reported_rad - joints_rad)
        return float(np.where(np.isfinite(off), off, 0.0).max())

    def _see(self, observation: Observation, now_s: float) -> bool:
        if isinstance(observation, PointSighting):
            return self.tracking.see_point(observation, now_s)
        if isinstance(observation, TrackSighting):
            return self.tracking.see_track(observation, now_s)
        if isinstance(observation, BoxSighting):
            return self.tracking.see_box(observation, now_s)
        return isinstance(observation, FoveaDisparity) and self.tracking.see_fovea(observation, now_s)

    def _see_rotation(self, seen: EyeRotationReading) -> None:
        if seen.usable and self.tracking.eyes_were_still(seen.stamp_s, seen.skew_s):
            left, right, _ = self.history.shaft_at(seen.stamp_s)
            self.vergence_offset.see(seen.stamp_s, seen.vergence_rad - float(right - left), seen.sigma_rad)

    def _see_contrast(self, seen: EdgeJudgement, now_s: float, law: Law, verging: bool) -> None:
        self.judge.see_contrast(seen.stamp_s, seen.contrast, seen.verged, now_s)
        if not (math.isfinite(seen.stamp_s) and self.history.covers(seen.stamp_s)):
            return
        if self.contrast is not None and seen.stamp_s <= self.contrast.stamp_s:
            return
        joints = self.history.shaft_at(seen.stamp_s)
        resting = self.tracking.eyes_were_still(seen.stamp_s, 0.0)
        self.contrast = Contrast(seen.stamp_s, seen.contrast, seen.metric_px, float(joints[1] - joints[0]), resting)
        if law.unsigned and resting and self.tracking.filter.initialised:
            self.judge.see_pair(seen.stamp_s, now_s, law.remaining_rad(), True, verging)

    def _foretell(self, stamp_s: float) -> None:
        """Keep the vergence error that is to be expected in a pair, before anything of it is looked at."""
        if stamp_s == self._foretold_s:
            return
        self._foretold_s, self._foretold = stamp_s, _NOTHING_KNOWN
        estimate = self.tracking.estimate(stamp_s)
        if estimate is None:
            return
        joints, moved = self.history.shaft_at(stamp_s), self._moves.variances_before(stamp_s)
        sigma = math.sqrt(float(estimate.covariance[1, 1] + moved[0] + moved[1]))
        self._foretold = Belief(estimate.vergence_rad - float(joints[1] - joints[0]), sigma)

    def _judge_pair(self, stamp_s: float, now_s: float, verging: bool) -> None:
        visual, by_point = self.tracking.visual, self.tracking.source == "point"
        if by_point:
            stamp_s = self.judge.exposure_for(stamp_s, now_s)
        estimate = self.tracking.estimate(stamp_s)
        if visual is None or estimate is None:
            return
        joints = self.history.shaft_at(stamp_s)
        errors = estimate.joints_rad - joints if by_point else visual.error_rad
        # With an eye held there is no version to correct: what is left is vergence, and the tilt.
        judged = [i for i in (range(3) if self._driven[:2].all() else (2,)) if self._driven[i]]
        measured = [abs(float(errors[i])) for i in judged]
        vergence_error = estimate.vergence_rad - float(joints[1] - joints[0])
        # The fovea's vergence is told from the left eye's own axis, wherever the target is beside it.
        left_error = 0.0 if self.tracking.source == "fovea" else visual.error_rad[0]
        seen_error = 0.0 if by_point else float(visual.error_rad[1] - left_error)
        error = max(abs(vergence_error), abs(seen_error) if math.isfinite(seen_error) else 0.0)
        aside = max((value for value in measured if math.isfinite(value)), default=0.0)
        # Eyes that sweep across the target are not verged on it; eyes that go along with it are.
        along = float(np.abs(estimate.rates_rad_s).max()) if estimate.moving else 0.0
        sweeping = self.history.speed_within(stamp_s - self._p.settle_s, stamp_s) > along + _SWEEPING_RAD_S
        certain = float(estimate.sigmas_rad[1]) < _STEADY_VERGENCE_RAD
        if self.tracking.source != "fovea":
            self.judge.see_place(stamp_s, error, aside)
        # What passed over the target when the pair was exposed is elsewhere by now; what has stayed on it stays.
        there = self._is_there(now_s) or self.judge.has_been_on_it(now_s)
        steady = certain and there and not sweeping and not self.tracking.doubtful
        left = 1.0
        # What moves, or may move, can be elsewhere by now: there one pair is never enough.
        if self.tracking.filter.surely_rests and not by_point and math.isfinite(visual.error_rad[1]):
            limit, off, sigmas = self._p.verged_leave_rad, estimate.joints_rad - joints, estimate.joint_sigmas_rad
            left = doubt(self._foretold, Belief(vergence_error, float(estimate.sigmas_rad[1])), limit)
            left += sum(Belief(float(off[i]), float(sigmas[i])).beyond(limit) for i in judged)
        placed = self.tracking.source != "fovea" or self.tracking.target_itself_unseen_s(now_s) < _PLACE_KNOWN_S
        self.judge.see_pair(stamp_s, now_s, error, steady, verging, left, aside, placed)

    def _is_there(self, now_s: float) -> bool:
        """Tell whether the eyes, as they stand by now, are on the target as it is predicted, as far as that is sure."""
        estimate, joints = self.tracking.estimate(now_s), self.history.shaft_rad
        if estimate is None:
            return False
        off, sigmas = estimate.joints_rad - joints, estimate.joint_sigmas_rad
        judged = self._driven if self._driven[:2].all() else self._driven & np.array([False, False, True])
        vergence = abs(estimate.vergence_rad - float(joints[1] - joints[0]))
        aside = float(np.abs(off[judged]).max(initial=0.0))
        if vergence > self.judge.enter_rad or aside > self.judge.aside_enter_rad:
            return False
        limit = self._p.verged_leave_rad
        beyond = sum(Belief(float(off[i]), float(sigmas[i])).beyond(limit) for i in np.flatnonzero(judged))
        return not estimate.moving or beyond < _DOUBT_OF_MOTION
