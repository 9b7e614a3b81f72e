"""Head on a drawn wall: goals, measurements and refusals; the simulated head is in test_simulated_head.py."""

import math

import numpy as np
import pytest

from vergence import BodyError, GoalError, Head, RequestError, Result
from vergence.recorded_body import RecordedBody
from vergence.testing.wall_body import WallBody
from vergence_rig.parameters import UnknownParameterError


def test_it_verges_on_a_pixel_and_says_so() -> None:
    with Head(WallBody()) as head:
        before = head.measure()
        look = head.look_at(pixel=(380, 200))
        assert look.outcome is None
        outcome = look.wait()
        after = head.measure()
    assert outcome.result is Result.VERGED, outcome
    assert look.verged
    assert before.disparity.horizontal_px == pytest.approx(12.0, abs=0.1)
    assert not before.verged
    assert after.verged
    assert abs(after.disparity.horizontal_px) < 1.5
    assert after.stamp_s > before.stamp_s
    assert "verged" in str(after)


def test_steps_by_hand_end_a_goal_as_wait_does() -> None:
    with Head(WallBody()) as one, Head(WallBody()) as other:
        waited = one.look_at(pixel=(330, 230)).wait()
        look = other.look_at(pixel=(330, 230))
        while look.outcome is None:
            other.step()
    assert look.outcome == waited


def test_a_newer_goal_preempts() -> None:
    with Head(WallBody()) as head:
        first = head.look_at(pixel=(330, 230))
        second = head.look_at(angles_rad=(0.05, 0.02, 0.0))
        assert second.wait().result is Result.VERGED
        assert first.outcome is not None
        assert first.outcome.result is Result.PREEMPTED
        assert head.report is not None
        assert head.report.version_rad == pytest.approx(0.05, abs=1e-3)


def test_a_stop_ends_the_goal() -> None:
    with Head(WallBody()) as head:
        look = head.look_at(pixel=(330, 230))
        head.stop()
        assert look.wait().result is Result.CANCELLED


def test_what_cannot_be_reached_is_refused_at_once_and_nothing_moves() -> None:
    body = WallBody()
    with Head(body) as head:
        head.run(0.1)
        with pytest.raises(GoalError, match="pan_left must be"):
            head.look_at(angles_rad=(2.0, 0.0, 0.0))
        head.run(0.1)
        assert np.array_equal(body.joints_rad, np.zeros(3))


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({}, "must be given one of"),
        ({"pixel": (1, 2), "point_m": (1, 0, 0)}, "pixel and point_m"),
        ({"pixel": (1, 2, 3)}, "pixel must be 2 finite numbers"),
        ({"pixel": (1, math.nan)}, "pixel must be 2 finite numbers"),
        ({"pixel": "left"}, "pixel must be 2 finite numbers"),
        ({"pixel": (1, 2), "eye": "middle"}, "eye must be"),
        ({"point_m": (1, 0, 0), "depth_m": 1.0}, "depth_m must be the distance of a pixel"),
        ({"pixel": (1, 2), "depth_m": -1.0}, "depth_m must be"),
    ],
)
def test_a_request_names_what_is_wrong_with_it(arguments: dict[str, object], text: str) -> None:
    with Head(WallBody()) as head, pytest.raises(RequestError, match=text):
        head.look_at(**arguments)  # type: ignore[arg-type]


def test_parameters_are_those_of_the_nodes() -> None:
    with Head(WallBody(), metric={"edges.windows_px": (40, 80)}, gaze={"mode": "left_held"}) as head:
        assert head.measure().edge.windows_px.tolist() == [40, 80]
        look = head.look_at(pixel=(330, 240))
        look.wait()
        assert head.body.joints_rad[0] == pytest.approx(0.0, abs=1e-6)  # type: ignore[attr-defined]
    with pytest.raises(UnknownParameterError, match=r"edges\.window"):
        Head(WallBody(), metric={"edges.window": 1})


def test_a_closed_head_says_so_and_closes_its_body() -> None:
    body = WallBody()
    head = Head(body)
    head.close()
    head.close()
    assert body.closed
    with pytest.raises(BodyError, match="was closed"):
        head.step()


def test_a_recorded_head_cannot_be_moved(tmp_path) -> None:
    with Head(WallBody()) as head:
        head.record(tmp_path / "bag")
        head.run(0.3)
        seen = head.measure()
    with Head.recording(tmp_path / "bag") as again:
        assert isinstance(again.body, RecordedBody)
        assert again.measure().disparity.horizontal_px == pytest.approx(seen.disparity.horizontal_px, abs=0.1)
        with pytest.raises(BodyError, match="has none"):
            again.look_at(pixel=(1, 2))
        with pytest.raises(BodyError, match="has ended"):
            again.run(10.0)
