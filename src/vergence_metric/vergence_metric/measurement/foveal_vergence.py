"""Whether the eyes are verged on what lies at the fovea: contrast and signed error together, with hysteresis."""

import math

from vergence_metric.measurement.parameters import VergedParameters
from vergence_rig.verged import objection


class FovealVergenceClassifier:
    """Classifies successive pairs as verged or not."""

    def __init__(self, parameters: VergedParameters) -> None:
        self._parameters = parameters
        self.verged = False

    def update(self, contrast: float, error_rad: float, confidence: float) -> bool:
        """Return whether the eyes are verged, given the contrast of a pair and its signed error [rad].

        `verged` is set by a low contrast with a small, confident error. It is cleared by a high contrast or by a large,
        confident error; an error of low confidence clears nothing.
        """
        p = self._parameters
        limit_rad = p.leave_rad if self.verged else p.enter_rad
        known = math.isfinite(error_rad) and confidence >= p.min_confidence
        errors = [("vergence", error_rad if known else math.nan, limit_rad)] if known or not self.verged else []
        against = objection(contrast, p.contrast_limit(self.verged), errors)
        self.verged = math.isfinite(contrast) and not against
        return self.verged
