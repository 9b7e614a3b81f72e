"""What is believed of the target: the filter, the newest sighting that went into it, and where that came from."""

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from vergence_gaze.estimation.kalman import Measurement
from vergence_gaze.estimation.target_filter import TargetEstimate, TargetFilter
from vergence_gaze.joints.joint_history import JointHistory
from vergence_gaze.joints.joint_moves import JointMoves
from vergence_gaze.laws.protocol import VisualError
from vergence_gaze.parameters import GazeParameters

Array = npt.NDArray[np.float64]


class BelievedTarget:
    """Takes measurements into the filter, with what the joints' moves before them have made of what it knew."""

    def __init__(self, parameters: GazeParameters, history: JointHistory, moves: JointMoves) -> None:
        self._p = parameters
        self._history, self._moves = history, moves
        self.filter = TargetFilter(
            parameters.follow_acceleration_rad_s2,
            parameters.manoeuvre_acceleration_rad_s2,
            parameters.still_drift_rad_sqrt_s,
            parameters.gate_sigma,
            parameters.jump_count,
        )
        self.forget()

    def forget(self) -> None:
        """Nothing is known of any target."""
        self.filter.forget()
        self.visual: VisualError | None = None
        self.seen_s = math.nan
        self.target_itself_seen_s = -math.inf
        """When something other than the fovea, which sees whatever lies there, was last believed."""
        self.source = ""
        self.note = ""

    def estimate(self, time_s: float) -> TargetEstimate | None:
        """Return the target at `time_s`, or None if there is none."""
        return self.filter.at(time_s) if self.filter.initialised else None

    def joint_rates_rad_s(self, time_s: float) -> Array:
        """Return how fast each joint (3,) turns while it follows the target; 0 while none moves."""
        estimate = self.estimate(time_s)
        return estimate.joint_rates_rad_s if estimate is not None and estimate.moving else np.zeros(3)

    def target_itself_unseen_s(self, now_s: float) -> float:
        """Return for how long nothing but the fovea has told of a target that was seen before; 0 if it never was."""
        seen_s = self.target_itself_seen_s
        return now_s - seen_s if math.isfinite(seen_s) else 0.0

    def start_from(self, measurement: Measurement) -> None:
        """Begin the filter at a first sighting, with the vergence that is assumed while only one eye sees."""
        wide = math.radians(60.0)
        joints = self._history.shaft_at(measurement.stamp_s)
        angles = np.array([0.5 * (joints[0] + joints[1]), self._p.prior_vergence_rad, joints[2]])
        sigma = wide if len(measurement.values) > 2 else self._p.prior_vergence_sigma_rad
        self.filter.start(measurement.stamp_s, angles, np.diag(np.square([wide, sigma, wide])))

    def heed_moves(self, stamp_s: float) -> None:
        """Let the filter know what the joints' moves before an exposure have made of what it knew."""
        for variances in self._moves.take_before(stamp_s):
            self.filter.loosen(variances)

    def believe(
        self,
        measurement: Measurement,
        seen_rad: Array,
        skew_s: float,
        now_s: float,
        source: str,
        may_jump: Callable[[], bool] = lambda: True,
    ) -> bool:
        """Take a measurement, or say in `note` why not.

        Args:
            measurement: what is measured.
            seen_rad: (left pan, right pan, tilt) (3,) of it; NaN where unseen.
            skew_s: how much later the right eye's image was exposed.
            now_s: the present.
            source: whose it is.
            may_jump: asked only if it is far from what is expected: may the target have jumped there?
        """
        self.heed_moves(measurement.stamp_s)
        if not (self.filter.update(measurement) or (may_jump() and self.filter.jump(measurement))):
            off_deg = math.degrees(self.filter.last_innovation_rad)
            self.note = f"{source} differs from the prediction by {off_deg:.1f} deg"
            return False
        if source == "fovea":
            # It tells only the depth; where the target lies is what is known of it.
            seen_rad = np.where(np.isnan(seen_rad), self.filter.at(measurement.stamp_s).joints_rad, seen_rad)
        else:
            self.target_itself_seen_s = now_s
        at_left = self._history.shaft_at(measurement.stamp_s)
        at_right = self._history.shaft_at(measurement.stamp_s + skew_s)
        error_rad = seen_rad - np.array([at_left[0], at_right[1], at_left[2]])
        self.visual = VisualError(measurement.stamp_s, seen_rad, error_rad)
        self.seen_s, self.source, self.note = now_s, source, ""
        return True
