"""Targets that swing, jump, pass before another, or are seen late or amiss: the core against the fake head, 50 Hz."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest

from vergence_gaze.control.controller import GazeController
from vergence_gaze.estimation.observations import BoxSighting, Observation, TrackSighting
from vergence_gaze.goals.goal import Goal, GoalKind
from vergence_gaze.parameter_groups import gaze_parameters
from vergence_gaze.phases import Phase
from vergence_gaze.testing.fake_head import TICK_S, FakeHead, VisionModel
from vergence_rig.rig import default_rig
from vergence_rig.servo import IDEAL, MG995, SG90, ServoSpec
from vergence_rig.testing.ideal_eyes import gaze_for_point

CONTROL_TICKS = 6
FRAME_RATE = VisionModel(
    track=False, boxes=True, box_frame_ticks=10, box_latency_s=0.06, box_noise_px=0.4, box_miss_share=0
)
DETECTOR = VisionModel(track=False, boxes=True, box_frame_ticks=20, box_latency_s=0.1, box_noise_px=1.2, noise_px=0.4)
Place = Callable[[float], np.ndarray]


@dataclass
class Trial:
    """What came of a target requested by its class, or by a click; sampled at the control rate.

    `arriving` alters what arrives at a time, or withholds it (None).
    """

    target: Place
    vision: VisionModel
    servo: ServoSpec = IDEAL
    until_s: float = 4.0
    law: str = "predictive"
    click: bool = False
    seed: int = 3
    mistaken: Mapping[str, Callable[[float], Any]] = field(default_factory=dict)
    start_rad: Mapping[str, float] | None = None
    arriving: Callable[[Observation, float], Observation | None] = lambda observation, time_s: observation

    def __post_init__(self) -> None:
        rig = default_rig().with_servos(self.servo)
        fixating = gaze_for_point(self.target(0.0), rig.baseline_m).as_dict()
        start = fixating if self.start_rad is None else self.start_rad
        head = FakeHead(rig, self.target, self.vision, self.seed, start, mistaken=self.mistaken)
        controller = GazeController(rig, gaze_parameters({"law": self.law}), CONTROL_TICKS * TICK_S)
        arrived: list[Any] = []
        samples: list[tuple[float, float, Phase, bool]] = []
        for tick in range(1, int(self.until_s / TICK_S)):
            altered = (self.arriving(observation, head.time_s) for observation in head.advance())
            arrived += [observation for observation in altered if observation is not None]
            if tick % CONTROL_TICKS:
                continue
            if tick == 30:
                x, y = head.project(head.target(head.time_s), left=True)
                goal = Goal(GoalKind.PIXEL, left_xy=(float(x), float(y)), time_limit_s=60.0)
                goal = goal if self.click else Goal(GoalKind.CLASS, class_name="target", time_limit_s=60.0)
                controller.look_at(goal, head.time_s)
            command = controller.step(head.time_s, arrived)
            arrived = []
            head.execute(command)
            error_deg = float(np.abs(np.degrees(head.true_errors_rad())).max())
            samples.append((head.time_s, error_deg, command.report.phase, command.report.verged))
        self.time_s = np.array([sample[0] for sample in samples])
        self.error_deg = np.array([sample[1] for sample in samples])
        self.phases = [sample[2] for sample in samples]
        self.reason = command.report.reason
        self.verged = np.array([sample[3] for sample in samples])

    def settled_s(self, after_s: float, within_deg: float) -> float:
        late = self.time_s > after_s
        outside = np.flatnonzero(self.error_deg[late] > within_deg)
        return float(self.time_s[late][outside[-1]]) - after_s if outside.size else 0.0


def place(distance_m: float, azimuth_deg: float) -> np.ndarray:
    azimuth = math.radians(azimuth_deg)
    return distance_m * np.array([math.cos(azimuth), math.sin(azimuth), 0.05])


def jump(before: np.ndarray, after: np.ndarray) -> Place:
    return lambda time_s: before if time_s < 1.5 else after


@pytest.mark.parametrize(("servo", "mean_deg"), [(IDEAL, 3.0), (SG90, 5.0)], ids=["ideal", "sg90"])
def test_a_swing_of_one_hertz_is_followed(servo: ServoSpec, mean_deg: float) -> None:
    def swing(time_s: float) -> np.ndarray:
        return place(0.8, 10.0 * math.sin(math.tau * max(time_s - 0.5, 0.0)))

    trial = Trial(swing, FRAME_RATE, servo, until_s=5.0)
    assert trial.error_deg[trial.time_s > 1.6].mean() < mean_deg
    assert Phase.LOST not in trial.phases[int(1.6 / (CONTROL_TICKS * TICK_S)) :]


@pytest.mark.parametrize("servo", [IDEAL, SG90], ids=["ideal", "sg90"])
@pytest.mark.parametrize(
    ("after", "soon_s"), [(place(0.8, 18.0), 0.25), (place(1.6, 3.0), 0.3), (place(0.4, 3.0), 0.3)]
)
def test_a_target_that_jumps_is_followed_at_once(servo: ServoSpec, after: np.ndarray, soon_s: float) -> None:
    trial = Trial(jump(place(0.8, 3.0), after), FRAME_RATE, servo, until_s=3.0)
    assert trial.settled_s(1.5, 0.3 if servo is IDEAL else 0.75) < soon_s


def test_eyes_in_a_saccade_are_not_called_verged() -> None:
    trial = Trial(jump(place(0.8, 3.0), place(0.8, 18.0)), FRAME_RATE, SG90, until_s=3.0)
    flying = np.array([phase is Phase.SACCADE for phase in trial.phases])
    assert flying[trial.time_s > 1.5].any()
    assert not trial.verged[flying].any()
    assert trial.verged[trial.time_s > 2.2].all()


def test_a_moving_target_that_a_slow_detector_shows_on_the_axes_is_called_verged() -> None:
    vision = replace(DETECTOR, box_latency_s=0.17, latency_s=0.12)
    trial = Trial(lambda time_s: place(0.6, 5.0 * (max(time_s, 0.8) - 2.5)), vision, SG90, until_s=5.0)
    late = trial.time_s > 2.5
    assert trial.verged[late].mean() > 0.6
    assert trial.error_deg[late & trial.verged].max() < 1.0


def test_saccades_that_land_at_rest_end_there_though_the_target_moves_on() -> None:
    trial = Trial(lambda time_s: place(0.8, 20.0 * (min(time_s, 4.0) - 2.0)), FRAME_RATE, law="pd_bangbang")
    saccades = "".join("s" if phase is Phase.SACCADE else " " for phase in trial.phases).split()
    assert len(saccades) >= 4
    assert np.median([len(saccade) for saccade in saccades]) * CONTROL_TICKS * TICK_S < 0.2


@pytest.mark.parametrize("click", [False, True], ids=["by_boxes", "by_track"])
@pytest.mark.parametrize("seed", range(4))
def test_a_target_that_passes_before_another_is_kept(click: bool, seed: int) -> None:
    random = np.random.default_rng([7, seed])
    other = place(0.6 * random.uniform(1.6, 2.2), 0.0)

    def azimuth_deg(time_s: float) -> float:
        return 10.0 * (min(max(time_s, 1.0), 4.0) - 2.5)

    def taken_for(near_deg: float, share: float) -> Callable[[float], np.ndarray | None]:
        draws = random.random(100)

        def mistaken(time_s: float) -> np.ndarray | None:
            wrong = abs(azimuth_deg(time_s)) < near_deg and draws[int(max(time_s, 0.0) * 10.0)] < share
            return other if wrong else None

        return mistaken

    mistaken = {"fovea": taken_for(2.5, 0.5), "track": taken_for(2.5, 0.5), "box": taken_for(6.0, 0.3)}
    vision = VisionModel(noise_px=0.4) if click else DETECTOR
    target = lambda time_s: place(0.6, azimuth_deg(time_s))  # noqa: E731
    trial = Trial(target, vision, SG90, 5.0, click=click, seed=seed, mistaken=mistaken)
    assert trial.error_deg[trial.time_s > 4.5].max() < 1.0
    if click:
        assert trial.error_deg[np.abs(trial.time_s - 2.5) < 0.6].max() < 2.0


@pytest.mark.parametrize("servo", [SG90, MG995], ids=["sg90", "mg995"])
@pytest.mark.parametrize("seed", range(5))
def test_eyes_that_swing_over_the_target_are_not_called_verged(servo: ServoSpec, seed: int) -> None:
    random = np.random.default_rng([11, seed])
    point = place(random.uniform(0.4, 1.5), random.uniform(-20.0, 20.0))
    start = {"pan_left": -0.1, "pan_right": 0.0, "tilt": 0.1}
    trial = Trial(lambda time_s: point, FRAME_RATE, servo, 3.0, law="pid_pursuit", seed=seed, start_rad=start)
    assert trial.verged[-1]
    assert trial.error_deg[trial.verged].max() < 1.0


LOADED = VisionModel(
    latency_s=0.12, frame_ticks=15, noise_px=0.4, boxes=True, box_frame_ticks=60, box_latency_s=0.16, box_noise_px=0.8
)
"""As on two full cores: 20 pairs a second, boxes at 5 Hz."""


def to_and_fro(time_s: float) -> np.ndarray:
    return np.array([0.6, 0.06 * math.sin(math.tau * 0.12 * max(time_s - 1.0, 0.0)), 0.0])


@pytest.mark.parametrize("target", [lambda time_s: to_and_fro(0.0), to_and_fro], ids=["at_rest", "moving"])
def test_a_track_that_slips_is_put_right_by_the_boxes(target: Place) -> None:
    def slipping(observation: Observation, time_s: float) -> Observation:
        if not isinstance(observation, TrackSighting):
            return observation
        slip = math.tan(math.radians(0.7 if time_s > 2.5 else 0.0))
        return replace(observation, left_x=observation.left_x + slip)

    trial = Trial(target, LOADED, until_s=7.0, arriving=slipping)
    assert np.median(trial.error_deg[trial.time_s > 4.5]) < 0.35
    assert trial.verged[trial.time_s > 4.5].mean() > 0.8


def test_a_moving_target_that_only_late_boxes_show_is_followed() -> None:
    vision = replace(LOADED, track=False, box_latency_s=0.6, box_frame_ticks=45)
    trial = Trial(to_and_fro, vision, until_s=8.0)
    assert np.median(trial.error_deg[trial.time_s > 2.5]) < 1.5
    assert trial.error_deg[trial.time_s > 2.5].max() < 4.0


SLOW_DETECTOR = replace(DETECTOR, box_frame_ticks=37, box_latency_s=0.14)


def at_twenty_degrees_a_second(time_s: float) -> np.ndarray:
    return place(0.8, -20.0 + 20.0 * min(max(time_s - 2.0, 0.0), 2.0))


@pytest.mark.parametrize("servo", [IDEAL, SG90])
def test_the_tracker_follows_a_class_between_its_boxes(servo: ServoSpec) -> None:
    alone, both = (
        Trial(at_twenty_degrees_a_second, replace(SLOW_DETECTOR, track=track), servo) for track in (False, True)
    )
    assert both.settled_s(2.0, 1.5) < 0.45
    assert both.settled_s(2.0, 1.5) < 0.6 * alone.settled_s(2.0, 1.5)
    assert both.verged[both.time_s > 3.0].mean() > 0.8


def test_a_track_without_boxes_is_not_followed_for_long() -> None:
    def no_boxes_later(observation: Observation, time_s: float) -> Observation | None:
        return None if isinstance(observation, BoxSighting) and time_s > 2.0 else observation

    vision = replace(SLOW_DETECTOR, track=True)
    trial = Trial(lambda time_s: place(0.8, 0.0), vision, arriving=no_boxes_later, until_s=5.0)
    known = [phase for phase, time_s in zip(trial.phases, trial.time_s, strict=True) if 1.5 < time_s < 2.5]
    assert set(known) == {Phase.FIXATE}
    assert Phase.LOST in [phase for phase, time_s in zip(trial.phases, trial.time_s, strict=True) if time_s < 4.0]
    assert not trial.verged[trial.time_s > 4.0].any()


@pytest.mark.parametrize("below_deg", [0.8, 2.5])
def test_a_track_that_locked_beside_what_is_wanted_does_not_pull_the_eyes_there(below_deg: float) -> None:
    def beside(observation: Observation, time_s: float) -> Observation:
        if not isinstance(observation, TrackSighting):
            return observation
        return replace(observation, left_y=observation.left_y + math.radians(below_deg))

    vision = replace(SLOW_DETECTOR, track=True)
    trial = Trial(lambda time_s: place(0.8, 5.0), vision, SG90, arriving=beside, start_rad={"pan_right": 0.06})
    assert trial.error_deg[trial.time_s > 1.0].max() < 0.75
    assert trial.verged[trial.time_s > 1.0].all()
