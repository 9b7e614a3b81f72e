"""Disparity estimators against shifts that were really resampled, and against images that have no answer."""

import math

import cv2
import numpy as np
import pytest

from vergence_metric.disparity import (
    Disparity,
    DisparityEstimator,
    DisparityInputError,
    DisparityStatus,
    estimator_names,
    make_estimator,
    register_estimator,
    registry,
)
from vergence_metric.disparity.parameters import DisparityParameters
from vergence_rig.parameters import ParameterError

WIDTH, HEIGHT = 640, 480


def texture(seed, size=1700):
    rng = np.random.default_rng(seed)
    out = np.zeros((size, size), np.float32)
    for sigma in (3.0, 6.0, 12.0, 24.0):
        out += cv2.GaussianBlur(rng.standard_normal((size, size)).astype(np.float32), (0, 0), sigma) * sigma
    return 128 + 45 * (out - out.mean()) / out.std()


def view(surface, shift_px=0.0, vertical_px=0.0, roll_deg=0.0, gain=1.0, noise=0.0, seed=0):
    """See a twice oversampled surface; the shifts are x_left - x_right and y_left - y_right at the centre."""
    x, y = np.meshgrid(
        np.arange(WIDTH) - (WIDTH - 1) / 2 + shift_px, np.arange(HEIGHT) - (HEIGHT - 1) / 2 + vertical_px
    )
    c, s = math.cos(math.radians(roll_deg)), math.sin(math.radians(roll_deg))
    middle = (surface.shape[0] - 1) / 2
    u, v = middle + 2 * (c * x + s * y), middle + 2 * (c * y - s * x)
    grey = 128 + gain * (cv2.remap(surface, u.astype(np.float32), v.astype(np.float32), cv2.INTER_LINEAR) - 128)
    grey = grey + np.random.default_rng(seed).normal(0.0, noise, grey.shape) if noise else grey
    return np.clip(np.rint(grey), 0, 255).astype(np.uint8)


def estimator(name="affine", **changes):
    return make_estimator(DisparityParameters(estimator=name, **changes))


@pytest.mark.parametrize("name", estimator_names())
@pytest.mark.parametrize("shift_px", [-131.37, -9.5, 0.0, 3.25, 57.8, 148.6])
def test_a_shift_is_found(name, shift_px):
    surface = texture(1)
    answer = estimator(name).estimate(view(surface), view(surface, shift_px))
    assert answer.status is DisparityStatus.OK
    assert answer.horizontal_px == pytest.approx(shift_px, abs=0.2)
    assert answer.vertical_px == pytest.approx(0.0, abs=0.2)
    assert answer.confidence > 0.5
    assert answer.estimator == name
    assert answer.point_px == ((WIDTH - 1) / 2, (HEIGHT - 1) / 2)


@pytest.mark.parametrize("name", estimator_names())
def test_noise_gain_roll_and_vertical_offset_together(name):
    surface = texture(2)
    left = view(surface, noise=8.0, seed=3)
    right = view(surface, 41.3, vertical_px=2.0, roll_deg=1.0, gain=1.3, noise=8.0, seed=4)
    answer = estimator(name).estimate(left, right)
    assert answer.ok
    assert answer.horizontal_px == pytest.approx(41.3, abs=0.1 if name == "affine" else 0.6)
    assert answer.vertical_px == pytest.approx(2.0, abs=0.1 if name == "affine" else 0.6)


def test_a_point_off_the_centre_and_an_expectation():
    surface = texture(5)
    left, right = view(surface), view(surface, 22.0)
    for expected_px in (None, 20.0, 24.5, -100.0):
        answer = estimator().estimate(left, right, point_px=(150.0, 90.0), expected_px=expected_px)
        assert answer.ok
        assert answer.horizontal_px == pytest.approx(22.0, abs=0.05)


@pytest.mark.parametrize("half_width_px", [9, 15, 40])
def test_the_surface_at_the_point_counts_and_not_the_one_behind(half_width_px):
    near, far = texture(6), texture(7)
    left, right = view(far, 0.0), view(far, 4.0)
    rows = slice(240 - half_width_px, 240 + half_width_px)
    left[rows, 320 - half_width_px : 320 + half_width_px] = view(near)[rows, 320 - half_width_px : 320 + half_width_px]
    shift = 12
    columns = slice(320 - half_width_px - shift, 320 + half_width_px - shift)
    right[rows, columns] = view(near, shift)[rows, columns]
    answer = estimator().estimate(left, right)
    assert answer.horizontal_px == pytest.approx(shift, abs=0.3)


@pytest.mark.parametrize("noise", [0.0, 3.0, 8.0])
def test_blank_walls_give_no_answer(noise):
    rng = np.random.default_rng(8)
    walls = [np.clip(np.rint(130 + rng.normal(0, noise, (HEIGHT, WIDTH))), 0, 255).astype(np.uint8) for _ in range(2)]
    answer = estimator().estimate(*walls)
    assert answer.status in (DisparityStatus.NO_TEXTURE, DisparityStatus.NO_MATCH)
    assert answer.confidence < 0.5
    if noise == 0.0:
        assert answer.status is DisparityStatus.NO_TEXTURE
        assert math.isnan(answer.horizontal_px)


@pytest.mark.parametrize("expected_px", [None, 0.0, 33.0])
def test_repeated_texture_is_ambiguous(expected_px):
    x = np.arange(WIDTH + 200)
    y = np.arange(HEIGHT)[:, None]
    board = (128 + 60 * np.sin(2 * np.pi * x / 33.0) * np.sin(2 * np.pi * y / 29.0)).astype(np.uint8)
    left, right = board[:, 100 : 100 + WIDTH], board[:, 107 : 107 + WIDTH]
    answer = estimator().estimate(left, right, expected_px=expected_px)
    assert answer.status is DisparityStatus.AMBIGUOUS
    assert answer.confidence <= 0.5


def test_unrelated_and_covered_eyes_do_not_match():
    left = view(texture(9))
    for right in (view(texture(10)), np.full_like(left, 20)):
        answer = estimator().estimate(left, right)
        assert answer.status is DisparityStatus.NO_MATCH
        assert answer.confidence < 0.5
        assert answer.reason


def test_a_disparity_beyond_the_range_is_not_taken_for_one_within():
    surface = texture(11)
    answer = estimator(max_px=40).estimate(view(surface), view(surface, 90.0))
    assert not answer.ok
    assert answer.confidence < 0.5


@pytest.mark.parametrize(
    ("left", "right", "point", "words"),
    [
        (np.zeros((10, 10), np.uint8), np.zeros((10, 11), np.uint8), None, r"\(10, 10\): got \(10, 11\)"),
        (np.zeros((10, 10, 3), np.uint8), np.zeros((10, 10), np.uint8), None, "left image must be .*: got uint8"),
        (np.zeros((10, 10), np.uint8), np.zeros((10, 10), np.float32), None, "right image must be .*: got float32"),
        (np.zeros((10, 10), np.uint8), np.zeros((10, 10), np.uint8), (10.0, 3.0), r"10x10.*\(10, 3\)"),
        (np.zeros((0, 10), np.uint8), np.zeros((0, 10), np.uint8), None, "not empty"),
    ],
)
def test_bad_input_is_named(left, right, point, words):
    with pytest.raises(DisparityInputError, match=words):
        estimator().estimate(left, right, point)


class RowSearch(DisparityEstimator):
    """An estimator with its own search: the shift of the point's row with the least absolute difference."""

    name = "row_search"

    def __init__(self, parameters):
        self._max_px = parameters.max_px

    def estimate_at(self, left, right, point_px, expected_px):
        x, y = round(point_px[0]), round(point_px[1])
        window = left[y, x - 20 : x + 21].astype(int)
        shifts = range(-self._max_px, self._max_px + 1)
        costs = [np.abs(right[y, x - d - 20 : x - d + 21].astype(int) - window).sum() for d in shifts]
        best = float(shifts[int(np.argmin(costs))])
        return Disparity(best, 0.0, 0.3, 0.9, DisparityStatus.OK, "", self.name, point_px)


@pytest.fixture
def row_search(monkeypatch):
    monkeypatch.setattr(registry, "_BUILDERS", dict(registry._BUILDERS))
    register_estimator(RowSearch.name, RowSearch)


def test_an_estimator_with_its_own_search_can_be_registered(row_search):
    surface = texture(12)
    answer = estimator("row_search").estimate(view(surface), view(surface, 37.0))
    assert answer.estimator == "row_search"
    assert answer.horizontal_px == pytest.approx(37.0)
    chosen = {spec.name: spec for spec in DisparityParameters.specs()}["estimator"]
    assert "row_search" in (chosen.choices or ())


def test_a_registered_estimator_works_behind_the_depth_policy(row_search):
    surface = texture(13)
    answer = estimator("row_search", depth_policy="largest").estimate(view(surface), view(surface, 37.0))
    assert answer.estimator == "row_search"
    assert answer.horizontal_px == pytest.approx(37.0)


def test_a_name_is_registered_once(row_search):
    with pytest.raises(ValueError, match="must be new: got 'row_search'"):
        register_estimator("row_search", RowSearch)


def test_a_name_that_is_not_registered_is_refused():
    assert "row_search" not in estimator_names()
    with pytest.raises(ParameterError, match="row_search"):
        estimator("row_search")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"windows_px": (10.0, 5.0)}, "strictly increasing"),
        ({"windows_px": ()}, "one or more"),
        ({"box_px": (1.0, 2.0, 3.0)}, "x_min"),
        ({"depth_policy": "box"}, "a box"),
        ({"estimator": "census"}, "affine"),
    ],
)
def test_parameters_that_do_not_fit_are_named(changes, words):
    with pytest.raises(ParameterError, match=words):
        DisparityParameters(**changes)


def test_sigma_grows_where_another_surface_is_in_sight():
    wall, thing = texture(8), texture(9)
    alone = estimator().estimate(view(wall), view(wall, 3.25))
    left, right = view(wall), view(wall, 3.25)
    left[220:260, 300:340] = view(thing)[220:260, 300:340]
    right[220:260, 290:330] = view(thing)[220:260, 300:340]
    among = estimator().estimate(left, right)
    assert among.horizontal_px == pytest.approx(10.0, abs=0.1)
    assert alone.sigma_px < 0.03 < 0.06 < among.sigma_px < 0.3
