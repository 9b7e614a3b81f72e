"""The schedule of exposures and publications: free-running, in order, honest when late."""

import itertools

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vergence_sim.parameters import SimParameters
from vergence_sim.real_time import Schedule


def _exposures(schedule, until_s, late_s=0.0):
    times: dict[str, list[float]] = {"left": [], "right": []}
    while schedule.next_due_s() < until_s:
        due = schedule.next_due_s()
        event = schedule.pop(due + late_s)
        if event.kind == "expose":
            times[event.eye].append(event.due_s)
    return times


def test_the_right_eye_keeps_its_offset_and_drifts():
    parameters = SimParameters.of(
        {"camera.frame_jitter_s": 0.0, "right_camera.clock_offset_s": 0.007, "right_camera.clock_drift": 0.001}
    )
    times = _exposures(Schedule(parameters, 0.0), 3.0)
    assert times["left"][1] - times["left"][0] == pytest.approx(1 / 30)
    assert times["right"][0] - times["left"][0] == pytest.approx(0.007)
    assert times["right"][60] - times["left"][60] == pytest.approx(0.007 + 60 * 0.001 / 30)


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 1000), st.floats(0, 0.01), st.floats(-0.02, 0.02))
def test_exposures_of_one_eye_never_change_places(seed, jitter_s, offset_s):
    parameters = SimParameters.of(
        {"seed": seed, "camera.frame_jitter_s": jitter_s, "right_camera.clock_offset_s": offset_s}
    )
    for times in _exposures(Schedule(parameters, 0.0), 1.0).values():
        assert len(times) >= 28
        assert all(later > earlier for earlier, later in itertools.pairwise(times))


def test_what_is_published_goes_out_when_it_is_due():
    schedule = Schedule(SimParameters(), 0.0)
    schedule.publish("left", 0.05, "picture")
    events = []
    while schedule.next_due_s() < 0.06:
        events.append(schedule.pop(schedule.next_due_s()))
    (published,) = [event for event in events if event.kind == "publish"]
    assert (published.eye, published.payload, published.due_s) == ("left", "picture", 0.05)
    assert [event.due_s for event in events] == sorted(event.due_s for event in events)


def test_a_late_machine_drops_exposures_and_counts_them():
    schedule = Schedule(SimParameters.of({"camera.frame_jitter_s": 0.0}), 0.0)
    times = _exposures(schedule, 1.0, late_s=0.2)
    assert schedule.dropped > 0
    for beats in times.values():
        # What is dropped leaves a gap; what is left stays on the beat.
        in_beats = [(beat - beats[0]) * 30 for beat in beats]
        assert in_beats == pytest.approx([round(beat) for beat in in_beats], abs=0.01)
        assert max(b - a for a, b in itertools.pairwise(beats)) > 1.5 / 30


def test_joints_come_at_their_own_rate():
    schedule = Schedule(SimParameters.of({"joint_rate_hz": 100.0}), 0.0)
    count = 0
    while schedule.next_due_s() < 0.995:
        count += schedule.pop(schedule.next_due_s()).kind == "joints"
    assert count == 100


def test_a_late_machine_still_publishes_the_joints_of_every_beat():
    schedule = Schedule(SimParameters.of({"joint_rate_hz": 100.0}), 0.0)
    stamps = []
    while schedule.next_due_s() < 0.995:
        event = schedule.pop(schedule.next_due_s() + 0.2)
        if event.kind == "joints":
            stamps.append(event.due_s)
    assert stamps == pytest.approx([0.01 * beat for beat in range(100)])


def test_a_machine_that_slept_does_not_publish_the_joints_of_all_that_time():
    schedule = Schedule(SimParameters.of({"joint_rate_hz": 100.0}), 0.0)
    late_s, stamps = 60.0, []
    for _ in range(300):
        event = schedule.pop(max(schedule.next_due_s(), late_s))
        if event.kind == "joints":
            stamps.append(event.due_s)
    assert len([stamp for stamp in stamps if stamp < late_s]) <= 102
