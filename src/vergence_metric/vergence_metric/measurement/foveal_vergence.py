"""Whether the eyes are verged: foveal contrast and signed error together, with hysteresis.

Contrast alone fails on repeated texture, the signed error alone on a confident mismatch; large windows mix depths and
have high contrast at vergence. On the scenes reserved for fitting a threshold of 0.52 separates best. The default is
higher, for targets smaller than the fovea, because the signed error has to agree; bench/bench_contrast.py scores both
on other scenes.
"""

import math

from vergence_metric.measurement.parameters import VergedParameters


class FovealVergenceClassifier:
    """Classifies successive pairs as verged or not."""

    def __init__(self, parameters: VergedParameters) -> None:
        self._parameters = parameters
        self.verged = False

    def update(self, contrast: float, error_px: float, confidence: float) -> bool:
        """Return whether the eyes are verged, given a pair's foveal contrast and its signed error [px].

        `verged` is set by a low contrast with a small, confident error. It is cleared by a high contrast or by a large,
        confident error; an error of low confidence clears nothing.
        """
        p = self._parameters
        confident = math.isfinite(error_px) and confidence >= p.min_confidence
        if not math.isfinite(contrast):
            self.verged = False
        elif self.verged:
            self.verged = contrast <= p.leave_contrast and not (confident and abs(error_px) > p.leave_px)
        else:
            self.verged = contrast <= p.enter_contrast and confident and abs(error_px) <= p.enter_px
        return self.verged
