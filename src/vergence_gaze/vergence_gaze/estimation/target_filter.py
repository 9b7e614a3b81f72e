"""Where the target is: at rest or in motion, whichever has explained the recent measurements better.

A model at rest keeps noise from moving the eyes; one in motion predicts along the target's speed (`imm_filter.py`). A
jump looks like an outlier until a second measurement is consistent with it.
"""

import math

import numpy as np
import numpy.typing as npt

from vergence_gaze.estimation import jump_detector as jumps
from vergence_gaze.estimation.imm_filter import ImmWeights
from vergence_gaze.estimation.jump_detector import RATE_SIGMA_RAD_S
from vergence_gaze.estimation.kalman import TILT, VERGENCE, VERSION, Innovations, KalmanModels, Measurement
from vergence_gaze.estimation.target_estimate import TargetEstimate

Array = npt.NDArray[np.float64]

_EVIDENCE_FADE = 0.8
_EVIDENCE_TO_MOVE = 7.0
_EVIDENCE_TO_REST = -2.0
_EVIDENCE_BOUNDS = (-6.0, 15.0)
_EVIDENCE_PER_MEASUREMENT = (-3.0, 7.5)
_EVIDENCE_SURE = 11.0
_SIGNIFICANT_RATE = 9.0
_COAST_STRAIGHT_S = 0.15
_COAST_FADE_S = 0.3
_JUMP_SIGMA_RAD = 0.3
_LONGEST_PREDICTION_S = 2.0
_LARGEST_VARIANCE = 1.0
_LATEST_S = 1.0
_COMPARABLE_S = 0.5
_MINIMUM_WEIGHT = 0.3
_FOLLOWING_VARIANCE = 1e-5
_KEPT_ESTIMATES = 8
_REST = 0
_MOTION = slice(1, 3)  # calm, manoeuvring


class TargetFilter:
    """The models, the evidence for each, and the gate."""

    def __init__(
        self,
        acceleration_rad_s2: float,
        manoeuvre_rad_s2: float,
        drift_rad_sqrt_s: float,
        gate_sigma: float,
        jump_count: int,
    ) -> None:
        accelerations = 0.0, acceleration_rad_s2, max(acceleration_rad_s2, manoeuvre_rad_s2)
        self._models = KalmanModels(accelerations, (drift_rad_sqrt_s, 0.0, 0.0))
        self._motion = ImmWeights()
        self._gate = gate_sigma**2
        self._jump_count = jump_count
        self._evidence = 0.0
        self._moving = False
        self._outliers: list[Measurement] = []
        self._time_s = math.nan
        self._estimates: dict[float, TargetEstimate] = {}  # at the times asked for since the last change
        self.last_accepted_s = math.nan
        self.last_innovation_rad = math.nan

    @property
    def initialised(self) -> bool:
        """True once there is a target."""
        return math.isfinite(self._time_s)

    @property
    def time_s(self) -> float:
        """Stamp of the newest measurement used."""
        return self._time_s

    @property
    def moving(self) -> bool:
        """True while the model in motion explains the measurements better."""
        return self._moving

    @property
    def surely_at_rest(self) -> bool:
        """True while the evidence is for a target at rest, not merely insufficient for one in motion."""
        return not self._moving and self._evidence < _EVIDENCE_TO_REST

    def initialise(self, stamp_s: float, angles_rad: Array, covariance: Array) -> None:
        """Start with a target at these angles (3,) with this covariance (3, 3), of unknown speed."""
        self._estimates.clear()
        states, covariances = np.zeros((3, 6)), np.zeros((3, 6, 6))
        states[:, 0::2], covariances[:, 0::2, 0::2] = angles_rad, covariance
        covariances[_MOTION, 1::2, 1::2] = np.eye(3) * RATE_SIGMA_RAD_S**2
        self._models.states, self._models.covariances = states, covariances
        self._motion.reset((1.0, 0.0))
        self._evidence, self._moving = 0.0, False
        self._outliers.clear()
        self._time_s = stamp_s

    def clear(self) -> None:
        """Remove the target."""
        self._time_s = math.nan
        self.last_accepted_s = math.nan
        self._outliers.clear()

    def inflate_covariance(self, joint_variances: Array) -> None:
        """Add variances (3,) [rad^2] of pan_left, pan_right and tilt, as a move of the joints leaves them."""
        self._estimates.clear()
        left, right, tilt = joint_variances
        extra = np.zeros((6, 6))
        extra[VERSION, VERSION] = 0.25 * (left + right)
        extra[VERGENCE, VERGENCE] = left + right
        extra[VERSION, VERGENCE] = extra[VERGENCE, VERSION] = 0.5 * (right - left)
        extra[TILT, TILT] = tilt
        self._models.covariances = self._models.covariances + extra

    def update(self, measurement: Measurement) -> bool:
        """Update by a measurement; returns False if it was too late or outside the gate (see `accept_jump`).

        A detector is slower than a tracker, so that stamps arrive out of order: the state is extrapolated back to the
        stamp along its rates, which is exact at rest and good for a moving target if the delay is a few frames.
        """
        if not self.initialised or measurement.stamp_s < self._time_s - _LATEST_S:
            return False
        self._estimates.clear()
        self._predict(measurement.stamp_s)
        innovations = self._models.innovations(measurement, self._time_s)
        self.last_innovation_rad = float(np.abs(innovations.values[1]).max())
        if not self._within_gate(measurement, innovations):
            comparable = [
                before
                for before in self._outliers
                if before.same_kind(measurement) and measurement.stamp_s - before.stamp_s < _COMPARABLE_S
            ]
            self._outliers = [*comparable[-self._jump_count :], measurement]
            return False
        # A depth within the gate does not contradict a direction outside it.
        self._outliers = [before for before in self._outliers if not before.same_kind(measurement)]
        losses = innovations.losses
        advantage = float(losses[_REST]) - self._motion.loss(losses[_MOTION])
        moved = self._moving
        self._update_evidence(advantage, len(measurement.values))
        if moved and not self._moving:
            innovations = self._models.innovations(measurement, self._time_s)  # from its new place
        self._update_models(measurement, innovations)
        return True

    def accept_jump(self, measurement: Measurement) -> bool:
        """Move the target to a measurement that `update` has just rejected, if enough before it are consistent."""
        consistent = self._outliers[-self._jump_count :]
        if len(consistent) < self._jump_count or consistent[-1] is not measurement:
            return False
        if not all(jumps.consistent(before, measurement) for before in consistent[:-1]):
            return False
        self._estimates.clear()
        self._reopen(consistent[0], measurement)
        if jumps.continues_moving(consistent[0], measurement, self._bound(measurement)):
            self._moving, self._evidence = True, _EVIDENCE_TO_MOVE
        self._update_models(measurement, self._models.innovations(measurement, self._time_s))
        return True

    def at(self, time_s: float) -> TargetEstimate:
        """Return the target at `time_s`. The extrapolated speed fades after a while, the uncertainty keeps growing."""
        if not self._moving:
            time_s = self._time_s  # at rest it is there at any time
        found = self._estimates.get(time_s)
        if found is None:
            if len(self._estimates) >= _KEPT_ESTIMATES:
                self._estimates.clear()
            found = self._estimates[time_s] = self._extrapolated(time_s)
        return found

    def _extrapolated(self, time_s: float) -> TargetEstimate:
        if not self._moving:
            state, spread = self._models.states[_REST], self._models.covariances[_REST]
            return TargetEstimate(state[0::2], state[1::2], spread[0::2, 0::2], False)
        state, spread = self._in_motion()
        ahead_s = min(max(time_s - self._time_s, -_LONGEST_PREDICTION_S), _LONGEST_PREDICTION_S)
        straight_s = min(ahead_s, _COAST_STRAIGHT_S)
        fade = math.exp(-(ahead_s - straight_s) / _COAST_FADE_S)
        angles = state[0::2] + state[1::2] * (straight_s + _COAST_FADE_S * (1.0 - fade))
        covariance = spread[0::2, 0::2]
        if ahead_s > 0:
            cross = spread[0::2, 1::2]
            covariance = covariance + ahead_s * (cross + cross.T) + ahead_s**2 * spread[1::2, 1::2]
        return TargetEstimate(angles, state[1::2] * fade, covariance, True)

    def _in_motion(self) -> tuple[Array, Array]:
        """Return state (6,) and covariance (6, 6) of the target in motion."""
        return self._motion.combined(self._models.states[_MOTION], self._models.covariances[_MOTION])

    def _predict(self, stamp_s: float) -> None:
        duration_s = min(stamp_s - self._time_s, _LONGEST_PREDICTION_S)
        if duration_s > 0:
            models = self._models
            states, covariances = self._motion.mixed(models.states[_MOTION], models.covariances[_MOTION], duration_s)
            models.states = np.concatenate((models.states[:1], states))
            models.covariances = np.concatenate((models.covariances[:1], covariances))
            models.predict(duration_s)
            if models.covariances.max() > _LARGEST_VARIANCE:
                largest = models.covariances.max(axis=(1, 2), keepdims=True)
                models.covariances = models.covariances * np.minimum(1.0, _LARGEST_VARIANCE / largest)
            self._time_s = stamp_s

    def _within_gate(self, measurement: Measurement, innovations: Innovations) -> bool:
        """Return whether a measurement is within the gate of a model that has enough weight."""
        bound, distances = self._bound(measurement), innovations.distances
        if not self._moving and distances[_REST] <= bound:
            return True
        pairs = zip(distances[_MOTION].tolist(), self._motion.weights, strict=True)
        return any(distance <= bound and weight > _MINIMUM_WEIGHT for distance, weight in pairs)

    def _update_evidence(self, advantage: float, rows: int) -> None:
        """Add to the evidence for motion; when it is used up, the model at rest takes over the target's place."""
        # One row is weak evidence: a constant depth is compatible with a direction that moves.
        least, most = _EVIDENCE_PER_MEASUREMENT
        evidence = _EVIDENCE_FADE ** (rows / 3.0) * self._evidence + min(max(advantage, least), most)
        self._evidence = min(max(evidence, _EVIDENCE_BOUNDS[0]), _EVIDENCE_BOUNDS[1])
        if self._moving:
            if self._evidence < _EVIDENCE_TO_REST:
                self._moving = False
                self._copy_place_to_rest()
            return
        self._moving = self._evidence > _EVIDENCE_SURE or (self._evidence > _EVIDENCE_TO_MOVE and self._rate_is_sure())

    def _rate_is_sure(self) -> bool:
        state, covariance = self._in_motion()
        rates, spread = state[1::2], covariance[1::2, 1::2]
        return float(rates @ np.linalg.solve(spread, rates)) > _SIGNIFICANT_RATE

    def _copy_place_to_rest(self) -> None:
        state, covariance = self._in_motion()
        models = self._models
        models.states, models.covariances = models.states.copy(), models.covariances.copy()
        models.states[_REST, 0::2] = state[0::2]
        models.covariances[_REST, 0::2, 0::2] = covariance[0::2, 0::2] + np.eye(3) * _FOLLOWING_VARIANCE

    def _update_models(self, measurement: Measurement, innovations: Innovations) -> None:
        models, off = self._models, float(innovations.distances[_REST]) / self._bound(measurement)
        if off > 1.0 and not self._moving:
            # It has moved somewhat: the farther, the less its old place counts.
            models.covariances = models.covariances * np.array([off, 1.0, 1.0])[:, None, None]
            innovations = models.innovations(measurement, self._time_s)
        models.update(innovations)
        self._motion.update(innovations.losses[_MOTION])
        if off > 1.0 and self._moving:
            # A model at rest outside its gate follows, so that it can take over when the target stops.
            self._copy_place_to_rest()
        self.last_accepted_s = measurement.stamp_s

    def _bound(self, measurement: Measurement) -> float:
        return self._gate + 2.0 * (len(measurement.values) - 1)

    def _reopen(self, before: Measurement, measurement: Measurement) -> None:
        """Widen the estimate for a target that is elsewhere, in the directions that were measured."""
        seen = np.abs(measurement.coefficients).max(axis=0) > 0
        if not seen[0]:
            # Only the depth: the left eye, which saw it, stays where it is.
            ways = np.array([[0.5, 1.0, 0.0]])
        elif len(measurement.values) < 3:
            # One eye's direction leaves the depth open: a jump sideways keeps the vergence.
            ways = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
        else:
            ways = np.eye(3)
        state, covariance = self._in_motion()
        covariance[0::2, 0::2] += ways.T @ ways * _JUMP_SIGMA_RAD**2
        covariance[0::2, 1::2] = covariance[1::2, 0::2] = 0.0
        state[1::2], variances = (
            jumps.rates_between(before, measurement) if len(ways) == 3 else (0.0, RATE_SIGMA_RAD_S**2)
        )
        covariance[1::2, 1::2] = np.eye(3) * variances
        models = self._models
        rest = models.covariances[_REST].copy()
        rest[0::2, 0::2] += ways.T @ ways * _JUMP_SIGMA_RAD**2
        models.states = np.stack((models.states[_REST], state, state))
        models.covariances = np.stack((rest, covariance, covariance))
        self._motion.reset((0.5, 0.5))
        self._evidence, self._moving = 0.0, False
        self._outliers.clear()
