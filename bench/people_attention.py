"""How long attention without a goal takes to find a person anywhere in reach, and how smoothly it turns the eyes.

One person at a time stands at random in all that the joints reach, 0.6 to 2.5 m away. The head has SG90 servos, looks
straight ahead and is given no goal; the person is found once the eyes are verged on it.
"""

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.results import Row
from vergence_gaze.control.controller import GazeController
from vergence_gaze.goals.goal import Goal, GoalKind
from vergence_gaze.parameter_groups import gaze_parameters
from vergence_gaze.testing.fake_head import FakeHead, VisionModel
from vergence_rig.kinematics import Kinematics
from vergence_rig.rig import Rig, default_rig
from vergence_rig.servo import SG90

Array = npt.NDArray[np.float64]

TRIALS = 60
_LIMIT_S = 30.0
_CYCLE_TICKS = 6
_ON_TARGET_RAD = math.radians(1.5)
_REACH_SHARE = 0.95  # of the joints' limits
_NEAREST_M, _FARTHEST_M = 0.6, 2.5


def rows(say: Callable[[str], None], trials: int = TRIALS) -> list[Row]:
    """Return people.scan_s and the figures beside it."""
    rig = default_rig().with_servos(SG90)
    places = _places(rig, trials)
    attending, fastest_rad_s = _times(rig, places, {"start": "attend"}, None)
    goal = Goal(GoalKind.CLASS, class_name="face", time_limit_s=_LIMIT_S)
    searching, search_rad_s = _times(rig, places, {}, goal)
    say(f"{trials} places: attention {_summary(attending)}; a class goal's search {_summary(searching)}")
    peer = "a class goal's search at full speed"
    return [
        Row("people.scan_s", float(np.median(attending)), "s, median", peer, float(np.median(searching))),
        Row("people.scan_worst_s", max(attending), "s", peer, max(searching)),
        Row("people.attention_speed", fastest_rad_s, "rad/s, largest commanded", peer, search_rad_s),
    ]


def _summary(times_s: list[float]) -> str:
    low, middle, high = np.percentile(times_s, (10, 50, 90))
    return f"{middle:.1f} s ({low:.1f} to {high:.1f})"


def _places(rig: Rig, count: int) -> list[Array]:
    """Return places (3,) [m], evenly spread over what the joints reach."""
    random, kinematics = np.random.default_rng(21), Kinematics(rig.in_eye_angles())
    found: list[Array] = []
    pan, tilt = rig.pan_left, rig.tilt
    while len(found) < count:
        version = random.uniform(pan.lower_rad, pan.upper_rad)
        down = random.uniform(tilt.lower_rad, tilt.upper_rad)
        away_m = random.uniform(_NEAREST_M, _FARTHEST_M)
        ahead = away_m * math.cos(version)
        place = np.array([ahead * math.cos(down), away_m * math.sin(version), -ahead * math.sin(down)])
        eyes = kinematics.gaze_for_point(place)
        pans = max(abs(eyes.pan_left_rad), abs(eyes.pan_right_rad))
        if pans <= _REACH_SHARE * pan.upper_rad and abs(eyes.tilt_rad) <= _REACH_SHARE * tilt.upper_rad:
            found.append(place)
    return found


def _times(
    rig: Rig, places: list[Array], parameters: Mapping[str, Any], goal: Goal | None
) -> tuple[list[float], float]:
    """Return the time [s] in which each place was verged on, `_LIMIT_S` where it was not, and the largest speed."""
    times, fastest_rad_s = [], 0.0
    for seed, place in enumerate(places):
        head = FakeHead(rig, _at(place), VisionModel(boxes=True), seed, class_name="face")
        controller = GazeController(rig, gaze_parameters(parameters), 0.02)
        arrived: list[Any] = []
        last: Array | None = None
        while head.time_s < _LIMIT_S:
            for _ in range(_CYCLE_TICKS):
                arrived += head.advance()
            if goal is not None and head.time_s < 1.5 * 0.02:
                controller.look_at(goal, head.time_s)
            command = controller.step(head.time_s, arrived)
            arrived = []
            head.execute(command)
            if command.joints_rad is not None and last is not None:
                fastest_rad_s = max(fastest_rad_s, float(np.abs(command.joints_rad - last).max()) / 0.02)
            last = command.joints_rad
            if command.report.verged and float(np.abs(head.true_errors_rad()).max()) < _ON_TARGET_RAD:
                break
        times.append(head.time_s)
    return times, fastest_rad_s


def _at(place: Array) -> Callable[[float], Array]:
    return lambda time_s: place
