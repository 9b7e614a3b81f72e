"""The estimate of the target: the filter, the newest measurement that updated it, and its source."""

import math

import numpy as np
import numpy.typing as npt

from vergence_gaze.estimation.kalman import Measurement
from vergence_gaze.estimation.target_estimate import TargetEstimate
from vergence_gaze.estimation.target_filter import TargetFilter
from vergence_gaze.estimation.visual_error import VisualError
from vergence_gaze.joints.joint_moves import JointMoves
from vergence_gaze.joints.shaft_history import ShaftHistory
from vergence_gaze.parameters import GazeParameters

Array = npt.NDArray[np.float64]


class TargetEstimator:
    """Updates the filter by measurements, after inflating its covariance for the joints' moves before them."""

    def __init__(self, parameters: GazeParameters, history: ShaftHistory, moves: JointMoves) -> None:
        self._p = parameters
        self._history, self._moves = history, moves
        self.filter = TargetFilter(
            parameters.target.calm_acceleration_rad_s2,
            parameters.target.manoeuvre_acceleration_rad_s2,
            parameters.target.rest_drift_rad_sqrt_s,
            parameters.target.gate_sigma,
            parameters.target.jump_count,
        )
        self.remove_target()

    def remove_target(self) -> None:
        """Remove the target and all that was measured of it."""
        self.filter.clear()
        self.visual: VisualError | None = None
        self.seen_s = math.nan
        self.source = ""
        self.note = ""

    def estimate(self, time_s: float) -> TargetEstimate | None:
        """Return the target at `time_s`, or None if there is none."""
        return self.filter.at(time_s) if self.filter.initialised else None

    def joint_rates_rad_s(self, time_s: float) -> Array:
        """Return how fast each joint (3,) turns while it follows the target; 0 while none moves."""
        estimate = self.estimate(time_s)
        return estimate.joint_rates_rad_s if estimate is not None and estimate.moving else np.zeros(3)

    def initialise_from(self, measurement: Measurement) -> None:
        """Start the filter at a first measurement, with the prior vergence while only one eye sees the target."""
        wide = math.radians(60.0)
        joints = self._history.shaft_at(measurement.stamp_s)
        angles = np.array([0.5 * (joints[0] + joints[1]), self._p.target.prior_vergence_rad, joints[2]])
        sigma = wide if len(measurement.values) > 2 else self._p.target.prior_vergence_sigma_rad
        self.filter.initialise(measurement.stamp_s, angles, np.diag(np.square([wide, sigma, wide])))

    def inflate_for_joint_motion(self, stamp_s: float) -> None:
        """Add the uncertainty of the joints' moves before an exposure to the filter's covariance."""
        for variances in self._moves.pop_before(stamp_s):
            self.filter.inflate_covariance(variances)

    def update(self, measurement: Measurement, seen_rad: Array, skew_s: float, now_s: float, source: str) -> bool:
        """Update the estimate by a measurement; returns False, with the reason in `note`, if it was rejected.

        Args:
            measurement: what is measured.
            seen_rad: (left pan, right pan, tilt) (3,) of it; NaN where unseen.
            skew_s: how much later the right eye's image was exposed.
            now_s: the present.
            source: the estimator that measured it.
        """
        if not (self.filter.update(measurement) or self.filter.accept_jump(measurement)):
            off_deg = math.degrees(self.filter.last_innovation_rad)
            self.note = f"{source} measurement is {off_deg:.1f} deg off the predicted target"
            return False
        at_left = self._history.shaft_at(measurement.stamp_s)
        at_right = self._history.shaft_at(measurement.stamp_s + skew_s)
        error_rad = seen_rad - np.array([at_left[0], at_right[1], at_left[2]])
        self.visual = VisualError(measurement.stamp_s, seen_rad, error_rad)
        self.seen_s, self.source, self.note = now_s, source, ""
        return True
