"""Identifying, piece by piece: timing of sampled steps, wiring, the split of the lags, poses, and what is written."""

import itertools
import math
import re
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
import yaml
from hypothesis import assume, given, reject, settings
from hypothesis import strategies as st

from vergence_calibration.identification.axis_log import EYES, IdentifyError, step_moves
from vergence_calibration.identification.latencies import Arrival, AxisTiming, Estimate, split
from vergence_calibration.identification.node_parameters import Owner, Owners, node_parameters
from vergence_calibration.identification.pose import pose_with_room
from vergence_calibration.identification.response import Response
from vergence_calibration.identification.step_timing import StepTiming, step_timing, steps_in
from vergence_calibration.identification.wiring_faults import cross_talk, wiring_faults
from vergence_rig.rig import JOINT_NAMES, JointSpec, Rig, default_rig
from vergence_rig.servo import SG90

DEG = math.pi / 180

# ---- timing


def sampled_steps(
    latency_s: float,
    speed_rad_s: float,
    period_s: float,
    jitter_s: float = 0.0,
    noise_rad: float = 2e-4,
    kept: float = 1.0,
    seed: int = 0,
    count: int = 14,
    travel: float = 1.0,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return commands, stamps and angles of steps to and fro, as a camera with this period would have seen them."""
    random = np.random.default_rng(seed)
    commands, now_s = [], 0.05
    for move in step_moves(3 * DEG, count, 0.45):
        commands.append((now_s, move.angle_rad))
        now_s += move.rest_s + move.share * period_s + random.uniform(0, 0.01)
    stamps = np.arange(random.uniform(0, period_s), now_s, period_s) + random.normal(0, 3e-4)
    stamps = stamps[random.random(len(stamps)) < kept]
    turning = [(begin_s + latency_s + random.normal(0, jitter_s), travel * angle) for begin_s, angle in commands]
    angles = np.zeros(len(stamps))
    for (begin_s, goal), (_, start) in zip(turning, [(0.0, 0.0), *turning[:-1]], strict=True):
        after = stamps > begin_s
        reach = speed_rad_s * (stamps[after] - begin_s)
        angles[after] = start + np.clip(goal - start, -reach, reach)
    return np.array(commands), stamps, angles + random.normal(0, noise_rad, len(stamps))


def timing_of(commands: np.ndarray, stamps: np.ndarray, angles: np.ndarray) -> StepTiming:
    return step_timing(steps_in(commands, stamps, angles, 0.4), 0.4, "pan_left, left eye")


@settings(deadline=None, max_examples=40, derandomize=True)
@given(
    latency_s=st.floats(0.0, 0.3),
    speed_deg_s=st.floats(120, 700),
    period_s=st.sampled_from([1 / 60, 1 / 30, 1 / 15]),
    jitter_s=st.sampled_from([0.0, 0.006]),
    kept=st.sampled_from([1.0, 0.75]),
    seed=st.integers(0, 10_000),
)
def test_a_latency_is_found_within_its_own_uncertainty(
    latency_s: float, speed_deg_s: float, period_s: float, jitter_s: float, kept: float, seed: int
):
    found = timing_of(*sampled_steps(latency_s, speed_deg_s * DEG, period_s, jitter_s, kept=kept, seed=seed))
    assert abs(found.onset_s - latency_s) < 4 * found.onset_sigma_s
    middle_s = latency_s + 3 * DEG / (speed_deg_s * DEG)
    assert abs(found.middle_s - middle_s) < 4 * found.middle_sigma_s
    # the uncertainty must be worth something: far below a frame
    assert found.middle_sigma_s < 0.25 * period_s + 0.5 * jitter_s + 0.001
    if found.speed_known:
        assert abs(found.speed_rad_s - speed_deg_s * DEG) < 4 * found.speed_sigma_rad_s


def test_stated_uncertainties_cover_as_often_as_they_should():
    misses = []
    for seed in range(60):
        latency_s = 0.01 + 0.004 * seed
        found = timing_of(*sampled_steps(latency_s, 500 * DEG, 1 / 30, 0.004 if seed % 2 else 0.0, seed=seed))
        misses.append(abs(found.onset_s - latency_s) / found.onset_sigma_s)
    # a normal error has 68 % within one deviation and 95 % within two; a grid and a prior are a little wide
    assert np.mean(np.array(misses) < 1) > 0.55
    assert np.mean(np.array(misses) < 2) > 0.88


def test_a_slow_servos_speed_is_told_and_a_fast_ones_is_not_claimed():
    slow = timing_of(*sampled_steps(0.05, 120 * DEG, 1 / 30))
    assert slow.speed_known
    assert slow.speed_rad_s == pytest.approx(120 * DEG, rel=0.15)
    assert not timing_of(*sampled_steps(0.05, 4000 * DEG, 1 / 15)).speed_known


def test_play_shortens_steps_and_moves_no_latency():
    found = timing_of(*sampled_steps(0.05, 600 * DEG, 1 / 30, travel=0.8))
    assert found.onset_s == pytest.approx(0.05, abs=4 * found.onset_sigma_s)


def test_a_few_steps_that_went_wrong_are_outvoted():
    commands, stamps, angles = sampled_steps(0.05, 600 * DEG, 1 / 30)
    begin_s = commands[5, 0]
    late = (stamps > begin_s) & (stamps < begin_s + 0.25)
    angles[late] = angles[stamps < begin_s][-1]  # a command that was held up by 0.2 s
    found = timing_of(commands, stamps, angles)
    assert found.onset_s == pytest.approx(0.05, abs=0.006)


@pytest.mark.parametrize(
    ("latency_s", "count", "text"),
    [(0.41, 14, "must come -50 to 400 ms"), (0.05, 2, "4 or more whole steps")],
)
def test_what_cannot_be_timed_is_refused(latency_s: float, count: int, text: str):
    with pytest.raises(IdentifyError, match=text) as refusal:
        timing_of(*sampled_steps(latency_s, 600 * DEG, 1 / 30, count=count))
    assert "pan_left, left eye" in str(refusal.value)


# ---- wiring


def head(
    slopes: Mapping[str, tuple[float, float, float, float]],
) -> dict[str, Response]:
    """Return responses from slopes: left pan, left tilt, right pan, right tilt."""
    return {
        joint: Response(joint, 3 * DEG, np.array(values, float).reshape(2, 2), np.full((2, 2), 0.3 * DEG))
        for joint, values in slopes.items()
    }


SOUND = {"pan_left": (1, 0, 0, 0), "pan_right": (0, 0, 1, 0), "tilt": (0, 1, 0, 1)}


def test_a_sound_head_has_no_complaints_even_with_rolled_cameras_and_play():
    rolled = {"pan_left": (0.85, 0.05, 0.01, 0), "pan_right": (0, 0.02, 0.9, -0.08), "tilt": (0.06, 0.9, -0.1, 0.95)}
    assert wiring_faults(head(SOUND)) == wiring_faults(head(rolled)) == []
    assert cross_talk(head(rolled)["tilt"]) == pytest.approx(0.1 / 0.925)


@pytest.mark.parametrize(
    ("changes", "texts"),
    [
        (
            {"pan_left": (-1, 0, 0, 0)},
            [r"^pan_left turns the wrong way: commanded \+3.0 degrees, seen -3.0.*`sign: -1`"],
        ),
        ({"tilt": (0, -1, 0, -1)}, [r"^tilt turns the wrong way: .*up instead of down.*`sign: -1` for tilt"]),
        (
            {"pan_left": (-1, 0, 0, 0), "pan_right": (0, 0, -1, 0)},
            ["^pan_left turns the wrong way", "^pan_right turns the wrong way"],
        ),
        (
            {"pan_left": (0, 0, 1, 0), "pan_right": (1, 0, 0, 0)},
            ["^pan_left moves the right image .* and pan_right moves the left image .*left_device and right_device"],
        ),
        (
            {"pan_left": (0, 0, -1, 0), "pan_right": (1, 0, 0, 0)},
            [r"^pan_left moves the right image \(commanded \+3.0 degrees, seen -3.0\)"],
        ),
        (
            {"pan_left": (0, 1, 0, 1), "tilt": (1, 0, 0, 0)},
            ["channels of pan_left and tilt", "channels of tilt and pan_left"],
        ),
        ({"pan_right": (0, 0, 0.02, 0)}, ["^pan_right does not move .* 15% or more of it: got 2%.*powered"]),
        ({"tilt": (0, -1, 0, 1), "pan_left": (-1, 0, 0, 0)}, ["^the left camera is mounted upside down"]),
        ({"pan_left": (0, 1, 0, 0)}, ["moves the left image up and down: that camera is mounted on its side"]),
        ({"pan_left": (1, 0, 1, 0)}, ["^pan_left turns both eyes to the side"]),
        (
            {"pan_right": (0, 0.1, 1, 0.3)},
            ["^pan_right must turn an eye in other directions by at most 20% .* got 30%"],
        ),
        ({"pan_left": (1, 1, -1, 1)}, ["^pan_left moves the eyes as no axis of this head should"]),
    ],
)
def test_every_fault_is_named_with_what_to_change(changes, texts):
    lines = wiring_faults(head(SOUND | changes))
    assert len(lines) == len(texts), lines
    for line, text in zip(lines, texts, strict=True):
        assert re.search(text, line), line


def test_a_single_axis_is_judged_alone():
    assert wiring_faults(head({"pan_right": (0, 0, 1, 0)})) == []
    assert "left_device" in wiring_faults(head({"pan_right": (1, 0, 0, 0)}))[0]


@given(
    joint=st.sampled_from(JOINT_NAMES),
    values=st.tuples(*[st.floats(-1.5, 1.5)] * 4),
)
@settings(deadline=None, max_examples=300)
def test_nothing_passes_that_turns_an_eye_the_wrong_way(joint: str, values: tuple[float, float, float, float]):
    own = np.array(SOUND[joint], bool)
    assume(np.array(values)[own].min() <= 0)
    assert wiring_faults(head({joint: values}))


# ---- the split of the lags


def timing(onset_s: float, sigma_s: float = 1e-3) -> StepTiming:
    return StepTiming(onset_s, sigma_s, onset_s + 0.005, sigma_s, 10.0, 1.0, 5e-4, 14)


def lags(servo: Mapping[str, float], late: Mapping[str, float], modelled_s: float) -> dict[str, AxisTiming]:
    eyes = {"pan_left": ("left",), "pan_right": ("right",), "tilt": EYES}
    return {
        joint: AxisTiming(joint, {eye: timing(latency_s + late[eye]) for eye in eyes[joint]}, timing(modelled_s))
        for joint, latency_s in servo.items()
    }


ARRIVALS = {eye: Arrival(0.045, 0.05, 1 / 30) for eye in EYES}
SERVO = {"pan_left": 0.03, "pan_right": 0.035, "tilt": 0.04}


def test_under_stamps_the_servos_have_the_lag_and_the_driver_is_corrected():
    found = split(lags(SERVO, {"left": 0.0, "right": 0.0}, 0.015), ARRIVALS, "stamps")
    for joint, latency_s in SERVO.items():
        assert found.servo_s[joint].value_s == pytest.approx(latency_s)
        assert found.joints_late_s[joint].value_s == pytest.approx(0.015 - latency_s)
    assert found.exposure_to_arrival_s["left"].value_s == pytest.approx(0.045)
    assert found.loop_s.value_s == pytest.approx(0.085)
    owners = Owners({"left": Owner("/left/camera_node", 0.0)}, Owner("/servo_node", 0.015))
    changes = node_parameters(found, owners)
    assert changes == {"/servo_node": {"ros__parameters": {"command_latency_s": pytest.approx(0.035)}}}


def test_under_joints_the_stamps_have_it_and_the_cameras_are_corrected():
    found = split(lags(dict.fromkeys(SERVO, 0.02), {"left": 0.012, "right": 0.03}, 0.02), ARRIVALS, "joints")
    assert found.stamp_late_s["left"].value_s == pytest.approx(0.012)
    assert found.stamp_late_s["right"].value_s == pytest.approx(0.03)
    assert all(latency.value_s == pytest.approx(0.02) for latency in found.servo_s.values())
    assert found.exposure_to_arrival_s["right"].value_s == pytest.approx(0.075)
    owners = Owners({eye: Owner(f"/{eye}/camera_node", 0.004) for eye in EYES}, Owner("/servo_node", 0.015))
    changes = node_parameters(found, owners)
    assert changes["/left/camera_node"]["ros__parameters"] == {"stamp_offset_s": pytest.approx(0.016)}
    assert changes["/right/camera_node"]["ros__parameters"] == {"stamp_offset_s": pytest.approx(0.034)}
    assert "/servo_node" not in changes


@settings(deadline=None, max_examples=100)
@given(shift_s=st.floats(-0.02, 0.02), assumption=st.sampled_from(["stamps", "joints"]))
def test_what_cannot_be_told_apart_is_not(shift_s: float, assumption: str):
    late = {"left": 0.01, "right": 0.01}
    one = split(lags(SERVO, late, 0.02), ARRIVALS, assumption)
    other = split(
        lags({j: s + shift_s for j, s in SERVO.items()}, {e: s - shift_s for e, s in late.items()}, 0.02),
        ARRIVALS,
        assumption,
    )
    for joint in SERVO:
        assert one.servo_s[joint].value_s == pytest.approx(other.servo_s[joint].value_s)


def test_a_camera_that_stamps_later_than_the_other_shows_in_the_tilt():
    found = split(lags(SERVO, {"left": 0.02, "right": 0.0}, 0.02), ARRIVALS, "stamps")
    assert found.eyes_apart_s.value_s == pytest.approx(0.02)
    assert found.stamp_late_s["left"].value_s == pytest.approx(0.02)
    assert found.stamp_late_s["right"].value_s == 0.0
    assert found.servo_s["pan_left"].value_s == pytest.approx(0.03)
    without = split(
        {j: t for j, t in lags(SERVO, {"left": 0.02, "right": 0.0}, 0.02).items() if j != "tilt"}, ARRIVALS, "stamps"
    )
    assert not without.eyes_apart_s.known
    assert without.servo_s["pan_left"].value_s == pytest.approx(0.05)


def test_assumptions_that_cannot_hold_are_refused():
    silent = {j: replace(t, reported=None) for j, t in lags(SERVO, {"left": 0, "right": 0}, 0.0).items()}
    with pytest.raises(IdentifyError, match="must be 'stamps'"):
        split(silent, ARRIVALS, "joints")
    assert not split(silent, ARRIVALS, "stamps").joints_late_s["tilt"].known
    with pytest.raises(IdentifyError, match=r"pan_left must move 0 to .* got -40 ms .* use the other assumption"):
        split(lags(dict.fromkeys(SERVO, -0.04), {"left": 0, "right": 0}, 0.0), ARRIVALS, "stamps")
    with pytest.raises(IdentifyError, match="stamps, joints"):
        split(silent, ARRIVALS, "neither")


def test_corrections_within_their_uncertainty_are_not_made():
    vague = Estimate(0.006, 0.003)
    found = split(lags(SERVO, {"left": 0, "right": 0}, 0.02), ARRIVALS, "stamps")
    found = replace(found, stamp_late_s=dict.fromkeys(EYES, vague), joints_late_s=dict.fromkeys(SERVO, vague))
    owners = Owners({eye: Owner(f"/{eye}/camera_node", 0.0) for eye in EYES}, None)
    assert node_parameters(found, owners) == {}
    assert yaml.safe_load(yaml.safe_dump(node_parameters(found, owners))) == {}


# ---- where the head stands meanwhile


def limited(low_deg: float, high_deg: float, minimum_vergence_rad: float) -> Rig:
    joint = JointSpec(low_deg * DEG, high_deg * DEG, 10.0, SG90)
    rig = default_rig()
    return replace(
        rig,
        joints=replace(rig.joints, pan_left=joint, pan_right=joint),
        minimum_vergence_rad=minimum_vergence_rad,
    )


@settings(deadline=None, max_examples=300)
@given(
    present=st.tuples(*[st.floats(-1.2, 1.2)] * 3),
    amplitude_deg=st.floats(1, 15),
    limits_deg=st.tuples(st.floats(-60, -5), st.floats(5, 60)),
    minimum_vergence_rad=st.floats(0, 0.1),
)
def test_moves_keep_to_limits_and_never_diverge(
    present: tuple[float, float, float],
    amplitude_deg: float,
    limits_deg: tuple[float, float],
    minimum_vergence_rad: float,
):
    rig, amplitude_rad = limited(*limits_deg, minimum_vergence_rad), amplitude_deg * DEG
    try:
        pose = pose_with_room(rig, dict(zip(JOINT_NAMES, present, strict=True)), amplitude_rad)
    except IdentifyError:
        reject()
    for name, sign in itertools.product(JOINT_NAMES, (-1, 1)):
        moved = pose | {name: pose[name] + sign * amplitude_rad}
        assert all(rig.joints[n].lower_rad <= angle <= rig.joints[n].upper_rad for n, angle in moved.items())
        assert moved["pan_right"] - moved["pan_left"] >= rig.minimum_vergence_rad - 1e-9


def test_a_pose_with_room_is_kept_and_too_little_room_is_refused():
    there = {"pan_left": -0.1, "pan_right": 0.1, "tilt": 0.2}
    assert pose_with_room(default_rig(), there, 3 * DEG) == there
    with pytest.raises(IdentifyError, match=r"pan_left must have a range of .*--amplitude-deg"):
        pose_with_room(limited(-2, 2, 0.0), there, 3 * DEG)
    with pytest.raises(IdentifyError, match=r"minimum_vergence_rad, 0\.3"):
        pose_with_room(limited(-9, 9, 0.3), there, 3 * DEG)
