"""Boards with portraits that stand for persons: where they are, how they move, and that they are seen."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vergence_sim.parameters import SimParameters
from vergence_sim.persons import BOARD_HALF_M, PERSON_CLASS, PERSONS, PersonParameters, person_place_m
from vergence_sim.portraits import drawn_portrait, portrait
from vergence_sim.renderer import RenderError
from vergence_sim.simulator import Simulator, TargetError

TWO = {"persons.count": 2, "target.z_m": -5.0}
counts = st.integers(1, len(PERSONS))


@settings(max_examples=80, deadline=None)
@given(counts, st.sampled_from(["static", "sway", "cross"]), st.floats(0.01, 2.0), st.floats(0.0, 60.0))
def test_persons_stay_within_their_extents(count, motion, frequency_hz, time_s):
    p = PersonParameters(count=count, motion=motion, frequency_hz=frequency_hz)
    for number in range(count):
        x, y, z = person_place_m(p, number, time_s)
        still = person_place_m(PersonParameters(count=count), number, 0.0)
        assert abs(x - still[0]) <= (p.amplitude_m / 3 if motion == "sway" else 0.0) + 1e-12
        extent = {"static": 0.0, "sway": p.amplitude_m, "cross": 2 * abs(still[1])}[motion]
        assert abs(y - still[1]) <= extent + 1e-12
        assert z == p.z_m


def test_those_that_cross_change_places():
    p = PersonParameters(count=2, motion="cross", frequency_hz=0.5)
    first, second = ([person_place_m(p, number, time_s)[1] for time_s in (0.0, 1.0, 2.0)] for number in (0, 1))
    assert first == pytest.approx([-0.225, 0.225, -0.225])
    assert second == pytest.approx([0.225, -0.225, 0.225])


def test_their_boxes_are_where_they_are():
    simulator = Simulator(SimParameters.ideal(TWO), render=False)
    boxes = simulator.true_boxes("left")
    assert [box.name for box in boxes] == [PERSON_CLASS] * 2
    for number, name in enumerate(PERSONS[:2]):
        box = simulator.true_box("left", name)
        assert box is not None
        x, y = simulator.project("left", simulator.person_place_m(number))
        assert 0.5 * (box.x_min_px + box.x_max_px) == pytest.approx(x, abs=2.0)
        assert 0.5 * (box.y_min_px + box.y_max_px) == pytest.approx(y, abs=2.0)
        away = math.dist(simulator.person_place_m(number), (0, 0.0325, 0))
        width = simulator.lenses["left"].camera.fx_px * 2 * BOARD_HALF_M[1] / away
        assert box.x_max_px - box.x_min_px == pytest.approx(width, rel=0.1)


def test_they_move_with_time_and_a_changed_motion_begins_anew():
    simulator = Simulator(SimParameters.ideal({**TWO, "persons.motion": "cross"}), render=False)
    before = simulator.person_place_m(0)
    simulator.advance(1.0)
    assert simulator.person_place_m(0)[1] > before[1] + 0.05
    simulator.set_parameters(simulator.parameters.replaced({"persons.frequency_hz": 0.3}))
    assert simulator.person_place_m(0) == pytest.approx(before)


def test_one_that_is_placed_stays_there_and_others_are_refused():
    simulator = Simulator(SimParameters.ideal({**TWO, "persons.motion": "sway"}), render=False)
    simulator.place_object("person2", (1.5, 0.1, 0.2))
    simulator.advance(3.0)
    assert simulator.person_place_m(1) == pytest.approx((1.5, 0.1, 0.2))
    with pytest.raises(TargetError, match="person3"):
        simulator.place_object("person3", (1.5, 0.1, 0.2))


def test_the_nearer_one_hides_the_farther_in_the_images():
    try:
        simulator = Simulator(SimParameters.ideal({**TWO, "persons.spacing_m": 0.0}))
    except RenderError as error:
        pytest.skip(f"no OpenGL here: {error}")
    together = simulator.view("left")
    simulator.place_object("person2", (0.0, 0.0, -5.0))
    assert np.abs(together.astype(int) - simulator.view("left")).mean() < 0.1
    simulator.place_object("person1", (0.0, 0.0, -5.0))
    assert np.abs(together.astype(int) - simulator.view("left")).mean() > 1.0
    simulator.close()


def test_portraits_are_of_different_persons_and_the_same_again():
    size = (120, 88)
    pictures = [portrait(number, seed=3, size_px=size) for number in range(len(PERSONS))]
    assert all(picture.shape == (*size, 3) for picture in pictures)
    for i, one in enumerate(pictures):
        assert np.array_equal(one, portrait(i, seed=3, size_px=size))
        assert all(np.abs(one.astype(int) - other).mean() > 15 for other in pictures[:i])
    assert drawn_portrait(np.random.default_rng(0), size).std() > 20
