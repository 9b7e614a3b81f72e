"""One estimate serves the fovea and a target near it, only where both lie on one smooth surface."""

import cv2
import numpy as np
import pytest

from vergence_metric.disparity import Disparity, make_estimator
from vergence_metric.disparity.parameters import DisparityParameters
from vergence_metric.disparity.protocol import DisparityEstimator, Image, Point
from vergence_metric.disparity.shared_estimate import SharedEstimate

FOVEA = (319.5, 239.5)
PARAMETERS = DisparityParameters()


class Counted(DisparityEstimator):
    """The shipped estimator, with a count of its estimates."""

    name = "counted"

    def __init__(self) -> None:
        self.estimates = 0
        self._estimator = make_estimator(PARAMETERS)

    def estimate_at(self, left: Image, right: Image, point_px: Point, expected_px: float | None) -> Disparity:
        self.estimates += 1
        return self._estimator.estimate_at(left, right, point_px, expected_px)


@pytest.fixture
def counted() -> Counted:
    return Counted()


@pytest.fixture
def shared(counted: Counted) -> SharedEstimate:
    return SharedEstimate(counted, PARAMETERS)


def plane(slope: float, edge_column: int = 10_000) -> tuple[Image, Image]:
    """Return both views of a plane whose disparity is 6 px at the centre.

    From `edge_column` of the left view on there is another one, 20 px farther; what only the right eye sees is noise.
    """
    scene = texture(3)
    y, x = np.mgrid[0:480, 0:640].astype(np.float32)
    right = cv2.remap(scene, (x - 319.5 + 6.0) / (1.0 - slope) + 319.5 + 100, y, cv2.INTER_CUBIC)
    far = cv2.remap(scene, x - 14.0 + 100, y, cv2.INTER_CUBIC)
    hidden = texture(4)[:, :640]
    right = np.where(x < edge_column - 6, right, np.where(x < edge_column + 14, hidden, far))
    left, right = (np.clip(np.rint(one), 0, 255).astype(np.uint8) for one in (scene[:, 100:740], right))
    return left, right


def texture(seed: int) -> np.ndarray:
    noise = cv2.GaussianBlur(np.random.default_rng(seed).normal(size=(480, 900)), (0, 0), 2.5).astype(np.float32)
    return 125 + 40 * noise / noise.std()


def test_the_same_point_of_the_same_pair_is_estimated_once(shared: SharedEstimate, counted: Counted) -> None:
    left, right = plane(0.0)
    first = shared.estimate(left, right)
    again = shared.estimate(left, right, (320.0, 240.0), first.horizontal_px + 1.0)
    assert counted.estimates == 1
    assert (again.horizontal_px, again.point_px) == (first.horizontal_px, (320.0, 240.0))


def test_another_pair_is_estimated_anew(shared: SharedEstimate, counted: Counted) -> None:
    left, right = plane(0.0)
    shared.estimate(left, right)
    shared.estimate(left, right.copy())
    assert counted.estimates == 2


def test_an_estimate_far_from_the_expected_one_is_not_shared(shared: SharedEstimate, counted: Counted) -> None:
    left, right = plane(0.0)
    shared.estimate(left, right)
    shared.estimate(left, right, FOVEA, 30.0)
    assert counted.estimates == 2


@pytest.mark.parametrize("away", [(5.0, 0.0), (-4.0, 6.0)])
def test_along_a_slanted_surface_the_estimate_is_carried(
    shared: SharedEstimate, counted: Counted, away: tuple[float, float]
) -> None:
    left, right = plane(0.06)
    point = FOVEA[0] + away[0], FOVEA[1] + away[1]
    shared.estimate(left, right)
    carried = shared.estimate(left, right, point)
    assert counted.estimates == 1
    there = make_estimator(PARAMETERS).estimate(left, right, point)
    assert carried.horizontal_px == pytest.approx(there.horizontal_px, abs=0.1)
    assert carried.vertical_px == pytest.approx(there.vertical_px, abs=0.1)
    assert carried.point_px == point


def test_beyond_a_depth_edge_or_far_away_nothing_is_shared(shared: SharedEstimate, counted: Counted) -> None:
    left, right = plane(0.0, edge_column=327)
    shared.estimate(left, right)
    shared.estimate(left, right, (FOVEA[0] + 6.0, FOVEA[1]))
    assert counted.estimates == 2
    left, right = plane(0.0)
    shared.estimate(left, right)
    shared.estimate(left, right, (FOVEA[0] + 9.0, FOVEA[1]))
    assert counted.estimates == 4
