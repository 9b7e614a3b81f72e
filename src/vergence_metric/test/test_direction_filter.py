"""Filters of directions: what the eye's reported angle does not tell exactly is not taken for motion."""

import numpy as np
import pytest

from vergence_metric.tracking.direction_filter import DirectionFilter

FRAME_S, SIGMA_RAD, RATE_RAD_S = 1 / 30, 0.001, 0.2


def rate_after_a_wrong_report(eye_sigma_rad):
    """Return how much the rate has changed after a report that is off by 0.01 rad."""
    which, angles = np.array([0]), np.zeros((1, 2))
    directions = DirectionFilter(angles, SIGMA_RAD)
    for _ in range(20):
        angles = angles + FRAME_S * RATE_RAD_S
        directions.predict(FRAME_S)
        directions.update(which, angles)
    assert directions.rates[0] == pytest.approx(RATE_RAD_S, rel=0.02)
    directions.predict(FRAME_S)
    directions.update(which, angles + FRAME_S * RATE_RAD_S + 0.01, eye_sigma_rad)
    return float(np.abs(directions.rates[0] - RATE_RAD_S).max())


def test_a_report_that_may_be_off_hardly_changes_a_rate():
    trusted, doubted = rate_after_a_wrong_report(0.0), rate_after_a_wrong_report(0.02)
    assert trusted > 0.1
    assert doubted < 0.02
