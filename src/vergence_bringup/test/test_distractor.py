"""The shipped detector on the demo's station for it, rendered without ROS: it finds the cube and nothing else."""

import math

import numpy as np
import pytest

from vergence_bringup.demo.stations import cube_with_distractor
from vergence_metric.boxes import BoxStatus, measure_pair
from vergence_sim.parameters import SimParameters
from vergence_sim.renderer import RenderError
from vergence_sim.simulator import Simulator


@pytest.fixture(scope="module")
def simulator():
    try:
        simulator = Simulator(SimParameters())
    except RenderError as error:
        pytest.skip(f"no OpenGL here: {error}")
    station = cube_with_distractor()
    assert station.place_m is not None
    assert station.distractor_m is not None
    simulator.place_target(station.target, station.place_m)
    simulator.place_object("distractor", station.distractor_m)
    yield simulator
    simulator.close()


@pytest.mark.parametrize("pans_deg", [(-0.5, 0.5), (5.2, 10.8)], ids=["at the start", "at vergence"])
def test_the_cube_is_found_and_the_nearer_look_alike_is_not(simulator, pans_deg):
    left_deg, right_deg = pans_deg
    simulator.set_head({"pan_left": math.radians(left_deg), "pan_right": math.radians(right_deg), "tilt": 0.0})
    frame = simulator.capture(0.0)
    found = measure_pair(frame.left, frame.right)
    assert found.status is BoxStatus.OK
    for eye, box, everything in (
        ("left", found.left, found.left_detections),
        ("right", found.right, found.right_detections),
    ):
        (true,) = simulator.true_boxes(eye)
        sides = (true.x_min_px, true.y_min_px, true.x_max_px, true.y_max_px)
        assert box is not None
        assert np.allclose(box.xyxy_px, sides, atol=8.0), eye
        assert len(everything) == 1
    assert found.refined.horizontal_px == pytest.approx(frame.truth.mean_disparity_px, abs=1.0)
