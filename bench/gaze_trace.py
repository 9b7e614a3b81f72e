"""The trace of a run of the controller, and when its errors became and stayed small."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


@dataclass
class Trace:
    """A run, sampled at the control rate: errors and joints (n, 3) in degrees; version, vergence, tilt and the pans."""

    time_s: Array
    errors_deg: Array
    joints_deg: Array
    commands_deg: Array
    verged: npt.NDArray[np.bool_]
    phase: npt.NDArray[np.int_]
    distance_m: Array
    step_s: Array
    first_result_s: float
    travel_s: float = 0.0

    @property
    def error_deg(self) -> Array:
        """The largest of the three true errors (n,)."""
        return np.abs(self.errors_deg).max(axis=1)

    def stays_within_from(self, tolerance: float, after_s: float = 0.0) -> float:
        """Time from which the true error stays within the tolerance to the end; infinite if it never does."""
        late = self.time_s >= after_s
        outside = np.flatnonzero(self.error_deg[late] > tolerance)
        times = self.time_s[late]
        if outside.size == 0:
            return float(times[0])
        return math.inf if outside[-1] + 1 >= times.size else float(times[outside[-1] + 1])

    def declared_from(self, after_s: float) -> float:
        """First time at or after `after_s` with `verged` in the state; infinite if never."""
        said = np.flatnonzero(self.verged & (self.time_s >= after_s))
        return float(self.time_s[said[0]]) if said.size else math.inf
