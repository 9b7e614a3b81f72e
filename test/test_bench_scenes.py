"""The rendered scenes of the benchmark `photos`: as wide as they claim, and the truth where the pixels are."""

from collections import Counter
from collections.abc import Iterator
from contextlib import closing

import numpy as np
import pytest

from bench.photos_scenes import MARKER, ROOMS, THIN, PointOfRoom, SceneTrial, settle, trials
from vergence_rig.rig import default_rig
from vergence_sim.fixation import fixated_surface, look_at
from vergence_sim.parameters import SimParameters
from vergence_sim.renderer import RenderError
from vergence_sim.scene import THIN_WIDTHS_M
from vergence_sim.simulator import Simulator

EVERY = trials()
SHOWN = [next(trial for trial in EVERY if trial.thing == thing) for thing in ("marker", *THIN_WIDTHS_M)]


@pytest.fixture(scope="module")
def simulator() -> Iterator[Simulator]:
    try:
        made = Simulator(SimParameters.ideal())
    except RenderError as error:
        pytest.skip(f"no OpenGL here: {error}")
    with closing(made):
        yield made


def test_the_trials_are_what_the_rows_promise() -> None:
    assert 40 <= len(EVERY) <= 60
    assert {trial.kind for trial in EVERY} == {MARKER, THIN}
    assert Counter(trial.room for trial in EVERY) == dict.fromkeys(ROOMS, len(EVERY) // len(ROOMS))
    assert all(0.4 <= trial.distance_m <= 1.5 for trial in EVERY)
    thin = [trial for trial in EVERY if trial.kind == THIN]
    assert {trial.thing for trial in thin} == set(THIN_WIDTHS_M)
    widths = [trial.width_px for trial in thin]
    assert 5 <= min(widths) < 7
    assert 13 < max(widths) <= 15
    assert trials() == EVERY


@pytest.mark.parametrize("trial", SHOWN, ids=[trial.thing for trial in SHOWN])
def test_a_thing_is_seen_as_wide_as_it_claims_and_where_the_truth_is(simulator: Simulator, trial: SceneTrial) -> None:
    point_m = fixated_surface(simulator, trial.thing, np.array(trial.centre_m))
    shown = look_at(simulator, point_m, 0.0)
    simulator.place_object(trial.thing, (0.0, 0.0, -5.0))
    hidden = look_at(simulator, point_m, 0.0)
    camera = simulator.rig.left_camera
    row = round(camera.cy_px)
    for eye, with_it, without in (("left", shown.left, hidden.left), ("right", shown.right, hidden.right)):
        changed = np.abs(with_it[row].astype(int) - without[row]).max(axis=1) > 12
        columns = np.flatnonzero(changed)
        # Here and there its colour is that of what stands behind.
        assert columns.size > 0.7 * trial.width_px, eye
        assert columns.max() - columns.min() + 1 == pytest.approx(trial.width_px, abs=2.0), eye
        assert 0.5 * (columns.min() + columns.max()) == pytest.approx(camera.cx_px, abs=1.5), eye
    clicked = PointOfRoom(simulator, point_m)
    assert clicked.errors_rad() == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)
    assert clicked.left_pixel() == pytest.approx((camera.cx_px, camera.cy_px), abs=1e-3)


def test_at_the_start_each_servo_rests_in_its_play() -> None:
    blind = Simulator(SimParameters.of({}), default_rig(), render=False)
    pose = {"pan_left": 0.02, "pan_right": 0.06, "tilt": -0.1}
    settle(blind, pose, np.random.default_rng(1))
    play = blind.rig.pan_left.servo.uncertainty_rad
    assert blind.joint_states() == pytest.approx(pose)
    off = [abs(blind.true_joints()[name] - angle) for name, angle in pose.items()]
    assert min(off) > 0
    assert max(off) <= play + 1e-9
