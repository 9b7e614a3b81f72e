"""Where the target is: at rest or in motion, whichever has explained the recent measurements better.

A target at rest is believed to be at rest, so that noise does not move the eyes; one in motion is predicted along its
speed (`motion.py`). A jump looks like an outlier until a second one agrees with it.
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vergence_gaze.estimation import jump_detector as jumps
from vergence_gaze.estimation.imm_filter import Motion
from vergence_gaze.estimation.jump_detector import RATE_SIGMA_RAD_S
from vergence_gaze.estimation.kalman import TILT, VERGENCE, VERSION, Fit, Kalman, Measurement

Array = npt.NDArray[np.float64]

_TO_JOINTS = np.array([[1.0, -0.5, 0.0], [1.0, 0.5, 0.0], [0.0, 0.0, 1.0]])
_EVIDENCE_FADE = 0.8
_EVIDENCE_TO_MOVE = 7.0
_EVIDENCE_TO_REST = -2.0
_EVIDENCE_BOUNDS = (-6.0, 15.0)
_OF_ONE_MEASUREMENT = (-3.0, 7.5)
_EVIDENCE_SURE = 11.0
_SIGNIFICANT_RATE = 9.0
_COAST_STRAIGHT_S = 0.15
_COAST_FADE_S = 0.3
_JUMP_SIGMA_RAD = 0.3
_LONGEST_PREDICTION_S = 2.0
_LARGEST_VARIANCE = 1.0
_LATEST_S = 1.0
_COMPARABLE_S = 0.5
_BELIEVED = 0.3
_FOLLOWING_VARIANCE = 1e-5


@dataclass(frozen=True)
class TargetEstimate:
    """The target at one time: angles that fixate it (3,) [rad], rates (3,) [rad/s], covariance of the angles (3, 3)."""

    angles_rad: Array
    rates_rad_s: Array
    covariance: Array
    moving: bool

    @property
    def version_rad(self) -> float:
        """Version that fixates the target."""
        return float(self.angles_rad[0])

    @property
    def vergence_rad(self) -> float:
        """Vergence that fixates the target."""
        return float(self.angles_rad[1])

    @property
    def tilt_rad(self) -> float:
        """Tilt that fixates the target."""
        return float(self.angles_rad[2])

    @property
    def joints_rad(self) -> Array:
        """Joint angles (3,), pan_left, pan_right, tilt, that fixate the target."""
        return _TO_JOINTS @ self.angles_rad

    @property
    def joint_rates_rad_s(self) -> Array:
        """How fast each joint (3,) turns while it follows the target."""
        return _TO_JOINTS @ self.rates_rad_s

    @property
    def joint_sigmas_rad(self) -> Array:
        """Standard deviations (3,) of the joint angles that fixate the target."""
        return np.sqrt(np.diag(_TO_JOINTS @ self.covariance @ _TO_JOINTS.T))

    @property
    def sigmas_rad(self) -> Array:
        """Standard deviations of the angles (3,)."""
        return np.sqrt(np.diag(self.covariance))


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
        self._rest = Kalman(0.0, drift_rad_sqrt_s)
        self._motion = Motion(acceleration_rad_s2, manoeuvre_rad_s2)
        self._gate = gate_sigma**2
        self._jump_count = jump_count
        self._evidence = 0.0
        self._moving = False
        self._outliers: list[Measurement] = []
        self._time_s = math.nan
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
        """True while the target is believed to move."""
        return self._moving

    @property
    def surely_rests(self) -> bool:
        """True while what was seen speaks for a target at rest, not only not yet for one in motion."""
        return not self._moving and self._evidence < _EVIDENCE_TO_REST

    def start(self, stamp_s: float, angles_rad: Array, covariance: Array) -> None:
        """Begin anew with a target at these angles (3,) with this covariance (3, 3), of unknown speed."""
        state, whole = np.zeros(6), np.zeros((6, 6))
        state[0::2], whole[0::2, 0::2] = angles_rad, covariance
        self._rest.state, self._rest.covariance = state, whole.copy()
        whole[1::2, 1::2] = np.eye(3) * RATE_SIGMA_RAD_S**2
        self._motion.start(state, whole)
        self._evidence, self._moving = 0.0, False
        self._outliers.clear()
        self._time_s = stamp_s

    def forget(self) -> None:
        """There is no target any more."""
        self._time_s = math.nan
        self.last_accepted_s = math.nan
        self._outliers.clear()

    def loosen(self, joint_variances: Array) -> None:
        """Add the variances (3,) [rad^2] that a move has brought into pan_left, pan_right and tilt."""
        left, right, tilt = joint_variances
        extra = np.zeros((6, 6))
        extra[VERSION, VERSION] = 0.25 * (left + right)
        extra[VERGENCE, VERGENCE] = left + right
        extra[VERSION, VERGENCE] = extra[VERGENCE, VERSION] = 0.5 * (right - left)
        extra[TILT, TILT] = tilt
        for model in (self._rest, *self._motion.modes):
            model.covariance = model.covariance + extra

    def update(self, measurement: Measurement) -> bool:
        """Take a measurement; False if it was too late or gated out (for now: it may turn out to be a jump).

        A detector is slower than a tracker, so that stamps arrive out of order: the state is taken back to the stamp
        along its rates, which is exact at rest and good for a moving target as long as the lateness is a few frames.
        """
        if not self.initialised or measurement.stamp_s < self._time_s - _LATEST_S:
            return False
        self._advance(measurement.stamp_s)
        rest, motion = self._rest.fit(measurement, self._time_s), self._motion.fits(measurement, self._time_s)
        self.last_innovation_rad = float(np.abs(motion[0].innovation).max())
        if not self._fits(measurement, rest, motion):
            comparable = [
                before
                for before in self._outliers
                if before.alike(measurement) and measurement.stamp_s - before.stamp_s < _COMPARABLE_S
            ]
            self._outliers = [*comparable[-self._jump_count :], measurement]
            return False
        # A depth that fits says nothing against a direction that does not.
        self._outliers = [before for before in self._outliers if not before.alike(measurement)]
        self._weigh(rest.loss - self._motion.loss(motion), len(measurement.values))
        self._take(measurement, motion)
        return True

    def jump(self, measurement: Measurement) -> bool:
        """Take a measurement that `update` has just refused, if enough before it agree: the target is elsewhere."""
        agreeing = self._outliers[-self._jump_count :]
        if len(agreeing) < self._jump_count or agreeing[-1] is not measurement:
            return False
        if not all(jumps.agree(before, measurement) for before in agreeing[:-1]):
            return False
        self._open(agreeing[0], measurement)
        if jumps.goes_on(agreeing[0], measurement, self._bound(measurement)):
            self._moving, self._evidence = True, _EVIDENCE_TO_MOVE
        self._take(measurement, self._motion.fits(measurement, self._time_s))
        return True

    def at(self, time_s: float) -> TargetEstimate:
        """Return the target at `time_s`. Speed is believed for a while and then fades, uncertainty grows on."""
        state, spread = self._motion.mixed() if self._moving else (self._rest.state, self._rest.covariance)
        ahead_s = min(max(time_s - self._time_s, -_LONGEST_PREDICTION_S), _LONGEST_PREDICTION_S)
        straight_s = min(ahead_s, _COAST_STRAIGHT_S)
        fade = math.exp(-(ahead_s - straight_s) / _COAST_FADE_S)
        angles = state[0::2] + state[1::2] * (straight_s + _COAST_FADE_S * (1.0 - fade))
        covariance = spread[0::2, 0::2]
        if self._moving and ahead_s > 0:
            cross = spread[0::2, 1::2]
            covariance = covariance + ahead_s * (cross + cross.T) + ahead_s**2 * spread[1::2, 1::2]
        return TargetEstimate(angles, state[1::2] * fade, covariance, self._moving)

    def _advance(self, stamp_s: float) -> None:
        duration_s = min(stamp_s - self._time_s, _LONGEST_PREDICTION_S)
        if duration_s > 0:
            self._rest.advance(duration_s)
            self._motion.advance(duration_s)
            for model in (self._rest, *self._motion.modes):
                model.covariance *= min(1.0, _LARGEST_VARIANCE / max(float(model.covariance.diagonal().max()), 1e-12))
            self._time_s = stamp_s

    def _fits(self, measurement: Measurement, rest: Fit, motion: tuple[Fit, Fit]) -> bool:
        """Tell whether a measurement may be of the target, by a model that is believed."""
        bound = self._bound(measurement)
        if not self._moving and rest.distance <= bound:
            return True
        believed = self._motion.weights > _BELIEVED
        return any(fit.distance <= bound for fit, yes in zip(motion, believed, strict=True) if yes)

    def _weigh(self, advantage: float, rows: int) -> None:
        """Add to the evidence for motion; at its end the model at rest takes over where the target is."""
        # One row alone does not tell much: a depth that stays says nothing of a direction that moves.
        least, most = _OF_ONE_MEASUREMENT
        evidence = _EVIDENCE_FADE ** (rows / 3.0) * self._evidence + min(max(advantage, least), most)
        self._evidence = min(max(evidence, _EVIDENCE_BOUNDS[0]), _EVIDENCE_BOUNDS[1])
        if self._moving:
            if self._evidence < _EVIDENCE_TO_REST:
                self._moving = False
                self._rest_where_it_moves()
            return
        state, covariance = self._motion.mixed()
        rates, spread = state[1::2], covariance[1::2, 1::2]
        significant = float(rates @ np.linalg.solve(spread, rates)) > _SIGNIFICANT_RATE
        self._moving = self._evidence > (_EVIDENCE_TO_MOVE if significant else _EVIDENCE_SURE)

    def _rest_where_it_moves(self) -> None:
        state, covariance = self._motion.mixed()
        self._rest.state[0::2] = state[0::2]
        self._rest.covariance[0::2, 0::2] = covariance[0::2, 0::2] + np.eye(3) * _FOLLOWING_VARIANCE

    def _take(self, measurement: Measurement, motion: tuple[Fit, Fit]) -> None:
        self._motion.correct(motion)
        rest = self._rest.fit(measurement, self._time_s)
        off = rest.distance / self._bound(measurement)
        if off > 1.0 and self._moving:
            # A model at rest that no longer fits follows, so that it can take over when the target stops.
            self._rest_where_it_moves()
        else:
            if off > 1.0:
                # It has moved somewhat: what was known of its place counts the less, the farther off that was.
                self._rest.covariance = self._rest.covariance * off
                rest = self._rest.fit(measurement, self._time_s)
            self._rest.correct(rest)
        self.last_accepted_s = measurement.stamp_s

    def _bound(self, measurement: Measurement) -> float:
        return self._gate + 2.0 * (len(measurement.values) - 1)

    def _open(self, before: Measurement, measurement: Measurement) -> None:
        """Open the estimate for a target that is elsewhere, in the directions that the measurements tell of."""
        seen = np.abs(measurement.coefficients).max(axis=0) > 0
        if not seen[0]:
            # Only the depth: the left eye, which saw it, stays where it is.
            ways = np.array([[0.5, 1.0, 0.0]])
        elif len(measurement.values) < 3:
            # One eye's direction leaves the depth open: a jump sideways keeps the vergence.
            ways = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
        else:
            ways = np.eye(3)
        state, covariance = self._motion.mixed()
        covariance[0::2, 0::2] += ways.T @ ways * _JUMP_SIGMA_RAD**2
        covariance[0::2, 1::2] = covariance[1::2, 0::2] = 0.0
        state[1::2], variances = jumps.speed(before, measurement) if len(ways) == 3 else (0.0, RATE_SIGMA_RAD_S**2)
        covariance[1::2, 1::2] = np.eye(3) * variances
        self._motion.start(state, covariance, (0.5, 0.5))
        self._rest.covariance = self._rest.covariance.copy()
        self._rest.covariance[0::2, 0::2] += ways.T @ ways * _JUMP_SIGMA_RAD**2
        self._evidence, self._moving = 0.0, False
        self._outliers.clear()
