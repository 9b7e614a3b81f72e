"""Motion scripts: where a target is about its place."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vergence_rig.parameters import ParameterError
from vergence_sim.motion import offset_m
from vergence_sim.parameters import MOTIONS, MotionParameters


def script(kind, **values):
    return MotionParameters(kind, x_m=0.1, y_m=-0.2, z_m=0.3, **values)


@pytest.mark.parametrize(
    ("motion", "elapsed_s", "share"),
    [("static", 5, 0), ("step", 0.99, 0), ("step", 1.01, 1), ("ramp", 0, 0), ("ramp", 2.5, 2.5), ("sinusoid", 0, 0)],
)
def test_scripts_move_by_their_extent(motion, elapsed_s, share):
    assert offset_m(script(motion), elapsed_s) == pytest.approx(np.array([0.1, -0.2, 0.3]) * share)


@settings(deadline=None, max_examples=50)
@given(st.floats(0.01, 5), st.floats(0, 20))
def test_a_sinusoid_repeats_and_turns_over(frequency_hz, elapsed_s):
    sinusoid = script("sinusoid", frequency_hz=frequency_hz)
    here, period_s = offset_m(sinusoid, elapsed_s), 1 / frequency_hz
    assert offset_m(sinusoid, elapsed_s + period_s) == pytest.approx(here, abs=1e-9)
    assert offset_m(sinusoid, elapsed_s + period_s / 2) == pytest.approx(-here, abs=1e-9)
    assert math.isclose(offset_m(sinusoid, period_s / 4)[2], 0.3)


def test_stations_are_taken_in_order_and_the_last_one_is_kept():
    stations = script("stations", stations_m=(0, 0, 0, 0.1, 0, 0, 0.1, 0.2, 0.3), station_s=0.5)
    places = [offset_m(stations, elapsed_s).tolist() for elapsed_s in (0.0, 0.49, 0.51, 1.2, 99.0)]
    assert places == [[0, 0, 0], [0, 0, 0], [0.1, 0, 0], [0.1, 0.2, 0.3], [0.1, 0.2, 0.3]]


@pytest.mark.parametrize("stations_m", [(), (1.0,), (0.0, 0.0, 0.0, 1.0)])
def test_stations_that_are_no_triples_are_refused(stations_m):
    with pytest.raises(ParameterError, match="stations_m"):
        script("stations", stations_m=stations_m)


@pytest.mark.parametrize("motion", MOTIONS)
def test_every_script_begins_at_the_place(motion):
    assert offset_m(script(motion), 0.0).tolist() == [0, 0, 0]
