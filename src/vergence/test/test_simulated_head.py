"""The simulated head steered without ROS: held against the simulator's own truth."""

import math

import cv2
import pytest

from vergence import Head, Result
from vergence.simulated_body import SimulatedBody
from vergence_sim.simulator import Simulator, TargetError

TARGET_M = (0.7, -0.12, 0.05)


def looked() -> tuple[object, tuple[float, float, float]]:
    with Head.simulated(TARGET_M) as head:
        assert isinstance(head.body, SimulatedBody)
        assert isinstance(head.body.world, Simulator)
        outcome = head.look_at(pixel=head.body.world.project("left", TARGET_M)).wait()
        return outcome, head.body.world.errors_to(TARGET_M)


def test_a_click_on_the_target_verges_both_eyes_on_it_and_the_same_way_every_time() -> None:
    (outcome, errors_rad), (again, errors_again_rad) = looked(), looked()
    assert outcome.result is Result.VERGED  # type: ignore[attr-defined]
    assert abs(errors_rad[0]) < math.radians(0.5)
    assert (again, errors_again_rad) == (outcome, errors_rad)


def test_a_target_nowhere_is_refused() -> None:
    with pytest.raises(TargetError, match="three finite numbers"):
        Head.simulated((1.0, 2.0))


def test_photographs_are_looked_at(tmp_path) -> None:
    left, right, _ = pytest.importorskip("skimage.data").stereo_motorcycle()
    for name, image in (("left", left), ("right", right)):
        cv2.imwrite(str(tmp_path / f"{name}.png"), image[..., ::-1])
    with Head.photographs(tmp_path / "left.png", tmp_path / "right.png") as head:
        outcome = head.look_at(pixel=(240, 160)).wait()
        head.run(0.3)  # until a pair shows the eyes as they rest
        found = head.measure()
    assert outcome.result is Result.VERGED, outcome
    assert found.verged
