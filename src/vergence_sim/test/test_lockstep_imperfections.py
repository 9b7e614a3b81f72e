"""Imperfections that need time: free-running clocks, servo latency, motion blur."""

import math

import cv2
import numpy as np
import pytest

from vergence_sim.optics import motion_blurred
from vergence_sim.parameters import SimParameters
from vergence_sim.renderer import RenderError
from vergence_sim.simulator import Simulator


@pytest.fixture
def simulator_with():
    made = []

    def make(values):
        try:
            made.append(Simulator(SimParameters.ideal().replaced({"preset": "realistic", **values})))
        except RenderError as error:
            pytest.skip(f"no OpenGL here: {error}")
        return made[-1]

    yield make
    for simulator in made:
        simulator.close()


@pytest.mark.parametrize("offset_s", [0.007, -0.012])
def test_a_pair_is_skewed_by_the_clocks_offset(simulator_with, offset_s):
    simulator = simulator_with({"right_camera.clock_offset_s": offset_s})
    simulator.advance_to(1.0)
    frame = simulator.capture()
    assert frame.right_stamp_s - frame.left_stamp_s == pytest.approx(offset_s)
    assert min(frame.right_stamp_s, frame.left_stamp_s) == 1.0
    assert simulator.time_s == pytest.approx(1.0 + abs(offset_s))


def test_clocks_drift_and_pairs_stay_within_half_a_period():
    drifting = SimParameters.of({"right_camera.clock_offset_s": 0.0, "right_camera.clock_drift": 0.001})
    simulator = Simulator(drifting, render=False)
    skews = []
    for second in range(80):
        simulator.advance_to(float(second))
        skews.append(simulator.skew_s)
    assert skews[10] == pytest.approx(0.01)
    assert skews[20] == pytest.approx(0.02 - 1 / 30)
    assert max(map(abs, skews)) <= 0.5 / 30


def test_the_right_eye_sees_a_moving_target_when_it_is_exposed(simulator_with):
    """A target that crosses at 1 m/s is elsewhere 10 ms later: the pair's disparity is short of the still one's."""

    def right_place(offset_s):
        simulator = simulator_with({"right_camera.clock_offset_s": offset_s, "motion.kind": "ramp", "motion.y_m": 1.0})
        simulator.place_target("cube", (0.8, 0.0, 0.0))
        frame = simulator.capture()
        simulator.place_target("cube", (0.0, 0.0, -5.0))
        changed = np.abs(frame.right.astype(int) - simulator.view("right")).max(axis=2) > 25
        return np.nonzero(changed)[1].mean()

    moved_px = right_place(0.01) - right_place(0.0)
    assert moved_px == pytest.approx(-539 * 0.01 / (0.8 - 0.0285), abs=1.0)


def test_a_servos_latency_can_be_set():
    late = Simulator(SimParameters.of({"servo": "sg90", "servo_latency_s": 0.06}), render=False)
    late.command({"pan_left": 0.3})
    late.advance(0.059)
    assert late.true_joints()["pan_left"] == late.joint_states()["pan_left"] == 0.0
    late.advance(0.01)
    assert late.joint_states()["pan_left"] == pytest.approx(math.radians(600) * 0.009)


def test_motion_blur_is_a_box_as_long_as_the_motion():
    dot = np.zeros((41, 61, 3), np.uint8)
    dot[20, 30] = 200
    along = motion_blurred(dot, (-10.0, 0.3))
    assert np.count_nonzero(along[:, :, 0]) == np.count_nonzero(along[20, :, 0]) == 10
    assert along[20, 30, 0] == 20
    assert np.count_nonzero(motion_blurred(dot, (0.0, 7.0))[:, 30, 0]) == 7
    assert motion_blurred(dot, (1.4, -1.0)) is dot


def test_a_turning_eyes_picture_smears_along_its_way_and_is_sharp_again_at_rest(simulator_with):
    simulator = simulator_with({"camera.exposure_s": 0.004})
    simulator.place_target("cube", (0.4, 0.0, 0.0))

    def sharpness():
        grey = cv2.cvtColor(simulator.view("left"), cv2.COLOR_BGR2GRAY).astype(np.float32)
        return [float(np.abs(np.diff(grey, axis=axis)).mean()) for axis in (0, 1)]

    still_y, still_x = sharpness()
    simulator.command({"pan_left": 0.5})
    simulator.advance(0.02)
    turning_y, turning_x = sharpness()
    simulator.advance(1.0)
    simulator.command({"pan_left": 0.0})
    simulator.advance(1.0)
    assert sharpness() == pytest.approx([still_y, still_x])
    assert turning_x < 0.4 * still_x
    assert turning_y / still_y > 1.5 * turning_x / still_x
