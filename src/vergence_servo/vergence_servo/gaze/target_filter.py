"""Where the target is: a Kalman filter on the version, vergence and tilt that fixate it.

State (6,): version, its rate, vergence, its rate, tilt, its rate [rad, rad/s], all in the frame of the joints as they
are estimated, so that what the filter says is what has to be commanded. Directions measured in one eye are linear in
it, at any distance: the left eye's pan to the target is version - vergence / 2, the right eye's version + vergence / 2.

Two models run side by side, a target at rest and one that moves; the one that has explained the recent measurements
better is believed. A target that jumps first looks like an outlier: outliers that agree with one another are the jump.
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

VERSION, VERGENCE, TILT = 0, 2, 4
_EVIDENCE_FADE = 0.8
_EVIDENCE_TO_MOVE = 7.0
_EVIDENCE_TO_REST = -2.0
_EVIDENCE_BOUNDS = (-6.0, 15.0)
_EVIDENCE_SURE = 11.0
_SIGNIFICANT_RATE = 9.0
_COAST_STRAIGHT_S = 0.15
_COAST_FADE_S = 0.3
_JUMP_SIGMA_RAD = 0.3
_RATE_SIGMA_RAD_S = 0.5
_LONGEST_PREDICTION_S = 2.0
_LARGEST_VARIANCE = 1.0
_LATEST_S = 0.3


@dataclass(frozen=True)
class Measurement:
    """Linear measurements of one pair: row i says coefficients[i] @ state(t) = values[i] +- sigmas[i].

    `coefficients` (n, 3) are for version, vergence, tilt; `stamps_s` (n,) the exposure that each belongs to.
    """

    coefficients: Array
    values: Array
    sigmas: Array
    stamps_s: Array

    @property
    def stamp_s(self) -> float:
        """The pair's stamp: the first row's."""
        return float(self.stamps_s[0])


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
        version, vergence, tilt = self.angles_rad
        return np.array([version - 0.5 * vergence, version + 0.5 * vergence, tilt])

    @property
    def sigmas_rad(self) -> Array:
        """Standard deviations of the angles (3,)."""
        return np.sqrt(np.diag(self.covariance))


class _Kalman:
    """One model. `acceleration` > 0: constant velocity with that random acceleration; 0: at rest with random walk."""

    def __init__(self, acceleration_rad_s2: float, drift_rad_sqrt_s: float) -> None:
        self._acceleration = acceleration_rad_s2
        self._drift = drift_rad_sqrt_s
        self.state = np.zeros(6)
        self.covariance = np.zeros((6, 6))

    @property
    def moves(self) -> bool:
        return self._acceleration > 0

    def advance(self, duration_s: float) -> None:
        transition = np.eye(6)
        noise = np.zeros((6, 6))
        for i in (VERSION, VERGENCE, TILT):
            noise[i, i] = self._drift**2 * duration_s
            if self.moves:
                transition[i, i + 1] = duration_s
                gain = np.array([0.5 * duration_s**2, duration_s]) * self._acceleration
                noise[i : i + 2, i : i + 2] += np.outer(gain, gain)
        self.state = transition @ self.state
        self.covariance = transition @ self.covariance @ transition.T + noise

    def innovation(self, measurement: Measurement, now_s: float) -> tuple[Array, Array, Array]:
        """Return the design (n, 6), innovation (n,) and its covariance (n, n)."""
        design = np.zeros((len(measurement.values), 6))
        design[:, 0::2] = measurement.coefficients
        if self.moves:
            design[:, 1::2] = measurement.coefficients * (measurement.stamps_s - now_s)[:, None]
        spread = design @ self.covariance @ design.T + np.diag(measurement.sigmas**2)
        return design, measurement.values - design @ self.state, spread

    def correct(self, design: Array, innovation: Array, spread: Array, sigmas: Array) -> None:
        gain = np.linalg.solve(spread, design @ self.covariance).T
        self.state = self.state + gain @ innovation
        # Joseph's form: the short one loses its positive variances where a certain measurement meets a vague prior.
        kept = np.eye(6) - gain @ design
        self.covariance = kept @ self.covariance @ kept.T + (gain * sigmas**2) @ gain.T


class TargetFilter:
    """The two models, their evidence, and the gate."""

    def __init__(self, acceleration_rad_s2: float, drift_rad_sqrt_s: float, gate_sigma: float, jump_count: int) -> None:
        self._models = (_Kalman(0.0, drift_rad_sqrt_s), _Kalman(acceleration_rad_s2, 0.0))
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

    def start(self, stamp_s: float, angles_rad: Array, covariance: Array) -> None:
        """Begin anew with a target at these angles (3,) with this covariance (3, 3), of unknown speed."""
        for model in self._models:
            model.state = np.zeros(6)
            model.state[0::2] = angles_rad
            model.covariance = np.zeros((6, 6))
            model.covariance[0::2, 0::2] = covariance
            if model.moves:
                model.covariance[1::2, 1::2] = np.eye(3) * _RATE_SIGMA_RAD_S**2
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
        for model in self._models:
            model.covariance = model.covariance + extra

    def update(self, measurement: Measurement, may_jump: bool = True) -> bool:
        """Take a measurement; False if it was too late or gated out (for now: it may turn out to be a jump).

        A detector is slower than a tracker, so that stamps arrive out of order: the state is taken back to the stamp
        along its rates, which is exact at rest and good for a moving target as long as the lateness is a few frames.
        """
        if not self.initialised or measurement.stamp_s < self._time_s - _LATEST_S:
            return False
        self._advance(measurement.stamp_s)
        terms = [model.innovation(measurement, self._time_s) for model in self._models]
        fits = [float(innovation @ np.linalg.solve(spread, innovation)) for _, innovation, spread in terms]
        bound = self._gate + 2.0 * (len(measurement.values) - 1)
        self.last_innovation_rad = float(np.abs(terms[1][1]).max())
        if min(fits) > bound:
            if not (may_jump and self._is_jump(measurement)):
                return False
            self._jump(measurement)
            terms = [model.innovation(measurement, self._time_s) for model in self._models]
        else:
            # A depth that fits says nothing against a direction that does not.
            self._outliers = [before for before in self._outliers if not _alike(before, measurement)]
            losses = [0.5 * (fit + math.log(np.linalg.det(term[2]))) for fit, term in zip(fits, terms, strict=True)]
            if self._weigh(losses[0] - losses[1]):
                terms = [model.innovation(measurement, self._time_s) for model in self._models]
        for model, fit, (design, innovation, spread) in zip(self._models, fits, terms, strict=True):
            if not model.moves and fit > bound and self._moving:
                # The target moves: a model at rest that no longer fits follows, so that it can take over when it stops.
                model.state[0::2] = self._models[1].state[0::2]
                model.covariance[0::2, 0::2] += np.eye(3) * 1e-5
                continue
            model.correct(design, innovation, spread, measurement.sigmas)
        self.last_accepted_s = measurement.stamp_s
        return True

    def at(self, time_s: float) -> TargetEstimate:
        """Return the target at `time_s`. Speed is believed for a while and then fades, uncertainty grows on."""
        model = self._models[1] if self._moving else self._models[0]
        ahead_s = min(max(time_s - self._time_s, -_LONGEST_PREDICTION_S), _LONGEST_PREDICTION_S)
        straight_s = min(ahead_s, _COAST_STRAIGHT_S)
        fading_s = _COAST_FADE_S * (1.0 - math.exp(-(ahead_s - straight_s) / _COAST_FADE_S))
        angles = model.state[0::2] + model.state[1::2] * (straight_s + fading_s)
        covariance = model.covariance[0::2, 0::2]
        if model.moves and ahead_s > 0:
            cross = model.covariance[0::2, 1::2]
            covariance = covariance + ahead_s * (cross + cross.T) + ahead_s**2 * model.covariance[1::2, 1::2]
        fade = math.exp(-(ahead_s - straight_s) / _COAST_FADE_S)
        return TargetEstimate(angles, model.state[1::2] * fade, covariance, self._moving)

    def _advance(self, stamp_s: float) -> None:
        duration_s = min(stamp_s - self._time_s, _LONGEST_PREDICTION_S)
        if duration_s > 0:
            for model in self._models:
                model.advance(duration_s)
                model.covariance *= min(1.0, _LARGEST_VARIANCE / max(float(model.covariance.diagonal().max()), 1e-12))
            self._time_s = stamp_s

    def _weigh(self, advantage: float) -> bool:
        """Add to the evidence for motion; True if the model at rest has taken over the moving one's estimate."""
        evidence = _EVIDENCE_FADE * self._evidence + max(min(advantage, 5.0), -3.0)
        self._evidence = min(max(evidence, _EVIDENCE_BOUNDS[0]), _EVIDENCE_BOUNDS[1])
        rates, spread = self._models[1].state[1::2], self._models[1].covariance[1::2, 1::2]
        significant = float(rates @ np.linalg.solve(spread, rates)) > _SIGNIFICANT_RATE
        if self._moving and self._evidence < _EVIDENCE_TO_REST:
            self._moving = False
            self._models[0].state[0::2] = self._models[1].state[0::2]
            self._models[0].covariance[0::2, 0::2] = self._models[1].covariance[0::2, 0::2]
            return True
        enough = _EVIDENCE_TO_MOVE if significant else _EVIDENCE_SURE
        if not self._moving and self._evidence > enough:
            self._moving = True
        return False

    def _is_jump(self, measurement: Measurement) -> bool:
        """Count `measurement` among the outliers; True once enough of them agree."""
        comparable = [
            before
            for before in self._outliers
            if _alike(before, measurement) and measurement.stamp_s - before.stamp_s < 0.5
        ]
        self._outliers = [*comparable[-self._jump_count :], measurement]
        if len(self._outliers) < self._jump_count:
            return False
        for before in self._outliers[-self._jump_count : -1]:
            allowed = 5.0 * np.hypot(before.sigmas, measurement.sigmas)
            allowed = allowed + 2.0 * _RATE_SIGMA_RAD_S * max(measurement.stamp_s - before.stamp_s, 0.0)
            if (np.abs(before.values - measurement.values) > allowed).any():
                return False
        return True

    def _jump(self, measurement: Measurement) -> None:
        """Open the estimate for a target that is elsewhere, in the directions that the measurement tells of."""
        seen = np.abs(measurement.coefficients).max(axis=0) > 0
        if not seen[0]:
            # Only the depth: the left eye, which saw it, stays where it is.
            ways = np.array([[0.5, 1.0, 0.0]])
        elif len(measurement.values) < 3:
            # One eye's direction leaves the depth open: a jump sideways keeps the vergence.
            ways = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
        else:
            ways = np.eye(3)
        spread = ways.T @ ways
        for model in self._models:
            model.covariance[0::2, 0::2] += spread * _JUMP_SIGMA_RAD**2
            model.state[1::2] = 0.0
            if model.moves:
                model.covariance[1::2, 1::2] += np.eye(3) * _RATE_SIGMA_RAD_S**2
        self._evidence, self._moving = 0.0, False
        self._outliers.clear()


def _alike(one: Measurement, other: Measurement) -> bool:
    """Tell whether two measurements are of the same kind."""
    return np.array_equal(one.coefficients, other.coefficients)
