"""Whether the eyes are verged: contrast in small windows together with the signed error, with hysteresis.

Contrast alone is fooled by texture that repeats, the signed error alone by a confident mismatch; large windows mix
depths and read high at vergence. Thresholds were fitted on drawn and photographed scenes and hold on others, see
bench/bench_contrast.py.
"""

import math

import numpy as np
from numpy.typing import NDArray

from vergence_metric.edge_parameters import EdgeMetricParameters

JUDGED_WINDOWS_PX = (50, 100)
"""Smallest and largest window whose contrast judges."""


def judged_contrast(windows_px: NDArray[np.uint32], contrast: NDArray[np.float64]) -> float:
    """Return the mean contrast of the windows of 50 to 100 px, of the smallest window if there is none among them.

    NaN where none of them has a contrast.
    """
    judging = (windows_px >= JUDGED_WINDOWS_PX[0]) & (windows_px <= JUDGED_WINDOWS_PX[1])
    if not judging.any():
        judging = windows_px == windows_px.min()
    known = contrast[judging][np.isfinite(contrast[judging])]
    return float(known.mean()) if known.size else math.nan


class VergedJudge:
    """Judges pair after pair."""

    def __init__(self, parameters: EdgeMetricParameters) -> None:
        self._parameters = parameters
        self.verged = False

    def update(self, contrast: float, error_px: float, confidence: float) -> bool:
        """Return whether the eyes are verged, given a pair's judged contrast and its signed error [px].

        To become verged takes a low contrast and a small, confident error. To stay verged takes a contrast that is not
        high and no confident error that is large: an estimator that does not know ends nothing.
        """
        p = self._parameters
        knows = math.isfinite(error_px) and confidence >= p.verged_confidence
        if not math.isfinite(contrast):
            self.verged = False
        elif self.verged:
            self.verged = contrast <= p.verged_leave_contrast and not (knows and abs(error_px) > p.verged_leave_px)
        else:
            self.verged = contrast <= p.verged_contrast and knows and abs(error_px) <= p.verged_px
        return self.verged
