"""The controller's state estimate: observations in; joints, target and `verged` out. It commands nothing."""

import math
from collections.abc import Callable, Sequence
from copy import copy
from functools import partial

import numpy as np
import numpy.typing as npt

from vergence_gaze.control.vergence_judge import VergenceJudge
from vergence_gaze.estimation.distance import UNKNOWN, TargetPosition, joint_variances, target_position
from vergence_gaze.estimation.evidence import Gaussian, probability_beyond_limit
from vergence_gaze.estimation.mount_drift import MountDrift, MountReading
from vergence_gaze.estimation.observations import (
    BoxSighting,
    EdgeContrast,
    EyeRotationObservation,
    JointReport,
    Observation,
    PointSighting,
    TrackSighting,
)
from vergence_gaze.estimation.target_estimate import TargetEstimate
from vergence_gaze.estimation.tracking import SightingError, TargetTracking
from vergence_gaze.estimation.vergence_offset import VergenceOffset, farthest_offset_rad
from vergence_gaze.estimation.visual_error import ContrastSample
from vergence_gaze.joints.joint_moves import JointMoves
from vergence_gaze.joints.resolution import pulse_steps_rad
from vergence_gaze.joints.shaft_history import ShaftHistory
from vergence_gaze.laws.protocol import Law
from vergence_gaze.parameters import GazeParameters
from vergence_rig.kinematics import Kinematics
from vergence_rig.rig import Rig

Array = npt.NDArray[np.float64]

LATEST_FUTURE_S = 1.0
_STILL_SPEED_RAD_S = 0.2  # joints that report less are at rest
_ARRIVED_RAD = 0.004  # joints this near to a command are where it sent them
_COMMANDED_AHEAD_S = 0.03  # while a target is followed, the command is ahead of the report by its way in this time
_NO_PREDICTION = Gaussian(0.0, math.inf)


class Perception:
    """The joints' history, the target's tracking, the judge of `verged`, and the visual encoder's offset."""

    def __init__(self, rig: Rig, parameters: GazeParameters) -> None:
        self._rig, self._described_steps_rad = rig, pulse_steps_rad(rig)
        self.kinematics = Kinematics(rig)
        self.mounts, self.mounts_corrected = MountDrift(), False
        self.history = ShaftHistory(rig)
        self.image_s = -math.inf
        self._images_fault, self._images_fault_s = "", -math.inf
        self.pair_s = self.exposure_s = math.nan
        self.contrast: ContrastSample | None = None
        self._predicted_error, self._predicted_s = _NO_PREDICTION, math.nan
        self._set_servos(rig)
        self.configure(parameters)

    def configure(self, parameters: GazeParameters) -> None:
        """Start again with other parameters."""
        self._p, self._driven = parameters, parameters.control.driven
        self.history.play.learning_share = parameters.servo.play_learning
        self._moves = JointMoves(self._rig, self.history)
        self.tracking = TargetTracking(self.kinematics, parameters, self.history, self._moves)
        self.judge = VergenceJudge(parameters.verged)
        self.judge.unresolved_rad, self.judge.dead_band_rad = self._unresolved_rad, self._dead_band_rad

    def set_rig(self, rig: Rig) -> None:
        """Use a rig whose servos have other steps; target and goal stay."""
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

    def expect_images(self, now_s: float) -> None:
        """Begin to wait for results of images, where none have arrived for so long that they would be missing."""
        if self.images_missing(now_s):
            self.image_s, self.exposure_s = now_s, math.nan

    def on_clock_reset(self) -> None:
        """Forget everything that has a stamp: the clock was set back."""
        self.history.clear()
        self.image_s, self.contrast = -math.inf, None
        self._images_fault, self._images_fault_s = "", -math.inf

    def update(self, observation: Observation, now_s: float, law: Law, verging: bool) -> None:
        """Update by one observation; `verging` says whether `verged` may be set now."""
        if isinstance(observation, JointReport):
            if self.history.add(observation.stamp_s, observation.positions_rad) and self._moves.update():
                self.vergence_offset.on_pan_moved(observation.stamp_s)
                self.mounts_corrected |= self.mounts.on_pan_moved()
            return
        if not (self.history.known and observation.stamp_s <= now_s + LATEST_FUTURE_S < math.inf):
            return
        if isinstance(observation, EyeRotationObservation):
            self._update_rotation(observation)
            return
        if isinstance(observation, TrackSighting):
            self._images_fault, self._images_fault_s = observation.images_fault, now_s
        if not isinstance(observation, PointSighting):
            if self.images_fault(now_s):
                return
            if now_s - observation.stamp_s <= self._p.control.no_images_s:
                self.image_s = now_s  # older ones show nothing of the present
            self.exposure_s = observation.stamp_s
        if isinstance(observation, EdgeContrast):
            self._update_contrast(observation, now_s, law, verging)
            return
        self._predict_error(observation.stamp_s)
        try:
            accepted = self._update_target(observation, now_s)
        except SightingError as error:
            self.tracking.note = str(error)
            return
        if accepted:
            self.pair_s = observation.stamp_s
            if not law.unsigned:
                self._judge_pair(observation.stamp_s, now_s, verging)

    def estimate(self, time_s: float) -> TargetEstimate | None:
        """Return the target at `time_s`, or None."""
        return self.tracking.estimate(time_s)

    def position(self, estimate: TargetEstimate | None) -> Callable[[], TargetPosition]:
        """Return a function that returns where the target is as of now, with its uncertainty."""
        if estimate is None:
            return lambda: UNKNOWN
        offset = copy(self.vergence_offset)
        return partial(target_position, estimate, self.kinematics, self._shaft_variances, offset)

    def unseen_s(self, now_s: float) -> float:
        """Return for how long images arrived that did not show the target; inf before the first that did.

        While no results from images arrive at all, the target is not lost: a starved graph is late, not blind.
        """
        if self.tracking.point is not None:
            return 0.0  # a point is looked at by the joints, whatever lies there
        seen_s = self.tracking.seen_s
        if not math.isfinite(seen_s):
            return math.inf
        images_arrive = now_s - self.image_s < self._p.control.no_images_s
        return max(0.0, (self.image_s if images_arrive else now_s) - seen_s)

    def images_fault(self, now_s: float) -> str:
        """Return why nothing in the images may be used, as the tracker says; "" while they may, or none arrive."""
        return self._images_fault if now_s - self._images_fault_s <= self._p.control.no_images_s else ""

    def images_missing(self, now_s: float) -> bool:
        """Return whether no results from images have arrived for so long that goals fail."""
        return not now_s - self.image_s <= self._p.control.no_images_s

    def eyes_still(self, now_s: float, command_rad: Array, at_rest: bool = False) -> bool:
        """Return whether the joints rest where commanded (3,), or turn along with the target unless `at_rest`."""
        along = np.zeros(3) if at_rest else self.tracking.joint_rates_rad_s(now_s)
        slow = self.history.speed_within(self.history.newest_s - 0.015, now_s, along) < _STILL_SPEED_RAD_S
        ahead_rad = _COMMANDED_AHEAD_S * max(map(abs, along.tolist()))
        return slow and self.distance_rad(command_rad) < _ARRIVED_RAD + ahead_rad

    def reached(self, joints_rad: Array) -> bool:
        """Return whether the joints are reported at these angles (3,); a joint whose angle is NaN is not compared."""
        return self.distance_rad(joints_rad) < _ARRIVED_RAD

    def distance_rad(self, joints_rad: Array) -> float:
        """Return how far the farthest joint is reported from these angles (3,) [rad], NaN left out."""
        off = (self.history.reported_rad - joints_rad).tolist()
        return max(abs(one) if math.isfinite(one) else 0.0 for one in off)

    def _update_target(self, observation: Observation, now_s: float) -> bool:
        if isinstance(observation, PointSighting):
            return self.tracking.update_point(observation, now_s)
        if isinstance(observation, TrackSighting):
            return self.tracking.update_track(observation, now_s)
        return isinstance(observation, BoxSighting) and self.tracking.update_box(observation, now_s)

    def _update_rotation(self, seen: EyeRotationObservation) -> None:
        if not self.tracking.eyes_were_still(seen.stamp_s, seen.skew_s):
            return
        if seen.contradictory:
            self.mounts.on_contradiction()
        if seen.usable:
            left, right, _ = self.history.shaft_at(seen.stamp_s)
            off_rad = seen.vergence_rad - float(right - left)
            self.vergence_offset.update(seen.stamp_s, off_rad, seen.sigma_rad)
            self.mounts.update(MountReading(off_rad, seen.roll_rad, seen.pitch_rad))

    def _update_contrast(self, seen: EdgeContrast, now_s: float, law: Law, verging: bool) -> None:
        self.judge.update_contrast(seen.stamp_s, seen.contrast, now_s)
        if not (law.unsigned and math.isfinite(seen.stamp_s) and self.history.covers(seen.stamp_s)):
            return
        if self.contrast is not None and seen.stamp_s <= self.contrast.stamp_s:
            return
        joints = self.history.shaft_at(seen.stamp_s)
        resting = self.tracking.eyes_were_still(seen.stamp_s, 0.0)
        self.contrast = ContrastSample(
            seen.stamp_s, seen.contrast, seen.metric_px, float(joints[1] - joints[0]), resting
        )
        if resting and self.tracking.filter.initialised:
            self.judge.update_pair(seen.stamp_s, now_s, law.remaining_rad(), True, verging)

    def _predict_error(self, stamp_s: float) -> None:
        """Keep the vergence error to be expected in a pair, before any of its measurements is used."""
        if stamp_s == self._predicted_s:
            return
        self._predicted_s, self._predicted_error = stamp_s, _NO_PREDICTION
        estimate = self.tracking.estimate(stamp_s)
        if estimate is None:
            return
        joints, moved = self.history.shaft_at(stamp_s), self._moves.variances_before(stamp_s)
        sigma = math.sqrt(float(estimate.covariance[1, 1] + moved[0] + moved[1]))
        self._predicted_error = Gaussian(estimate.vergence_rad - float(joints[1] - joints[0]), sigma)

    def _judge_pair(self, stamp_s: float, now_s: float, verging: bool) -> None:
        visual, by_point = self.tracking.visual, self.tracking.source == "point"
        self.judge.target_moves = self.tracking.filter.moving
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
        seen_error = 0.0 if by_point else float(visual.error_rad[1] - visual.error_rad[0])
        error = max(abs(vergence_error), abs(seen_error) if math.isfinite(seen_error) else 0.0)
        direction_error = max((value for value in measured if math.isfinite(value)), default=0.0)
        self.judge.update_target(stamp_s, error, direction_error)
        steady, probability = self._is_steady(estimate, stamp_s, now_s), 1.0
        # A target that moves, or may move, can be elsewhere by now: there one pair is never enough.
        if self.tracking.filter.surely_at_rest and not by_point and math.isfinite(visual.error_rad[1]):
            probability = self._error_probability(estimate, joints, judged)
        objection = self.tracking.ambiguity
        self.judge.update_pair(stamp_s, now_s, error, steady, verging, probability, direction_error, objection)

    def _is_steady(self, estimate: TargetEstimate, stamp_s: float, now_s: float) -> bool:
        """Return whether the estimate of a pair is certain, and the eyes rest on it, or turn along with it."""
        # Eyes that sweep across the target are not verged on it; eyes that turn along with it are.
        along = float(np.abs(estimate.rates_rad_s).max()) if estimate.moving else 0.0
        sweeping = (
            self.history.speed_within(stamp_s - self._p.exposure.settle_s, stamp_s) > along + self._p.verged.sweep_rad_s
        )
        certain = float(estimate.sigmas_rad[1]) < self._p.verged.steady_rad
        if sweeping or not certain:
            return False
        # Eyes that passed over the target at the exposure are elsewhere by now; eyes that were on it for long stay.
        if not (self.judge.long_on_target(now_s) or self._on_target(now_s)):
            return False
        # Since the exposure a correction may have been sent: until it has ended, one eye is ahead of the other. A small
        # one has mostly ended by the time this is known.
        turned_rad = float(np.abs(self.history.reported_rad - self.history.reported_at(stamp_s)).max())
        correcting = not along and max(turned_rad, 0.5 * self.history.sent_since(stamp_s)) > self.judge.enter_rad
        return not correcting

    def _error_probability(self, estimate: TargetEstimate, joints_rad: Array, judged: Sequence[int]) -> float:
        """Return how probable an error beyond the limit is, by the prediction before the pair and by the pair."""
        p, off, sigmas = self._p.verged, estimate.joints_rad - joints_rad, estimate.joint_sigmas_rad
        vergence_error = estimate.vergence_rad - float(joints_rad[1] - joints_rad[0])
        measured = Gaussian(vergence_error, float(estimate.sigmas_rad[1]))
        probability = probability_beyond_limit(
            self._predicted_error, measured, p.leave_rad, p.wrong_share, p.wrong_range_rad
        )
        return probability + sum(
            Gaussian(float(off[i]), float(sigmas[i])).probability_beyond(p.leave_rad) for i in judged
        )

    def _on_target(self, now_s: float) -> bool:
        """Return whether the eyes by now are on the predicted target, with enough certainty.

        A target at rest must be where the last command sends them, too: one eye may have set off beside it.
        """
        estimate = self.tracking.estimate(now_s)
        if estimate is None:
            return False
        places = (self.history.shaft_rad,) if estimate.moving else (self.history.shaft_rad, self.history.sent_rad)
        return all(self._within_limits(estimate, joints_rad) for joints_rad in places)

    def _within_limits(self, estimate: TargetEstimate, joints_rad: Array) -> bool:
        off, sigmas = estimate.joints_rad - joints_rad, estimate.joint_sigmas_rad
        judged = self._driven if self._driven[:2].all() else self._driven & np.array([False, False, True])
        vergence = abs(estimate.vergence_rad - float(joints_rad[1] - joints_rad[0]))
        direction_error = float(np.abs(off[judged]).max(initial=0.0))
        if vergence > self.judge.enter_rad or direction_error > self.judge.direction_enter_rad:
            return False
        limit = self._p.verged.leave_rad
        beyond = sum(
            Gaussian(float(off[i]), float(sigmas[i])).probability_beyond(limit) for i in np.flatnonzero(judged)
        )
        return not estimate.moving or beyond < self._p.verged.moving_error_probability
