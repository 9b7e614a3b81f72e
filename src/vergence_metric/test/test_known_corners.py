"""The corners of a target: which are expected when it is seen again."""

import numpy as np

from vergence_metric.tracking.known_corners import KnownCorners


def test_a_corner_that_was_not_seen_for_long_stays_known_but_is_no_longer_expected():
    corners = KnownCorners(0.001, 20.0)
    places, patches = np.array([[10.0, 10.0], [30.0, 10.0]]), np.ones((2, 81), np.float32)
    corners.append(places, patches, np.zeros((2, 2)), np.zeros(2), established=True)
    for _ in range(9):
        corners.update(np.array([0]), places[:1], patches[:1], np.array([True]))
        corners.forget()
    assert corners.expected.tolist() == [True, True]
    corners.update(np.array([0]), places[:1], patches[:1], np.array([True]))
    corners.forget()
    assert corners.expected.tolist() == [True, False]
    assert corners.established.tolist() == [True, True]
