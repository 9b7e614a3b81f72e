"""Whether the eyes are verged: contrast of the fovea together with the signed error, with hysteresis.

Contrast alone is fooled by texture that repeats, the signed error alone by a confident mismatch; large windows mix
depths and read high at vergence. On the scenes set aside for fitting 0.52 separates best. The shipped threshold is more
lenient, for targets smaller than the fovea, as the signed error has to agree; bench/bench_contrast.py scores both on
other scenes.
"""

import math

from vergence_metric.edges.parameters import EdgeMetricParameters


class VergedJudge:
    """Judges pair after pair."""

    def __init__(self, parameters: EdgeMetricParameters) -> None:
        self._parameters = parameters
        self.verged = False

    def update(self, contrast: float, error_px: float, confidence: float) -> bool:
        """Return whether the eyes are verged, given a pair's foveal contrast and its signed error [px].

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
