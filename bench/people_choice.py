"""How steadily one of several persons is chosen: boards with portraits that sway and cross in the simulated room.

A detector of persons is simulated: true boxes with noise, some missed, some of nothing, none of a person that another
one hides by half. Metric II is the shipped one; the eyes follow the chosen person, and their joints are off by their
dead band.
"""

import itertools
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.results import Row
from vergence_metric.boxes.detections import Detections, make_detections
from vergence_metric.boxes.measurement import BoxMeasurement
from vergence_metric.boxes.parameters import BoxMetricParameters
from vergence_metric.boxes.result import BoxVergenceResult
from vergence_rig.camera import CameraModel
from vergence_rig.geometry import EyeAngles
from vergence_rig.kinematics import Kinematics
from vergence_rig.rig import default_rig
from vergence_sim.parameters import SimParameters
from vergence_sim.persons import PERSON_CLASS, PERSONS
from vergence_sim.simulator import Simulator
from vergence_sim.truth import TrueBox
from vergence_sim.world import EYES

Array = npt.NDArray[np.float64]

RUN_S = 60.0
SEEDS = 4
_PERIOD_S = 0.1
_NOISE_PX, _MISSED, _FALSE = 1.5, 0.05, 0.02
_HIDDEN_SHARE = 0.5
_JOINT_ERROR_RAD = 0.004
_FOLLOWED_SHARE = 0.4  # of the way to the chosen person that the eyes turn from pair to pair
_PROCESSES = 2


@dataclass(frozen=True)
class Trial:
    """Persons of one world, and the policy by which one is chosen."""

    count: int
    motion: str
    policy: str
    seed: int


@dataclass(frozen=True)
class Outcome:
    """Changes of the chosen person, changes of a person's id, and how often an id went to another person."""

    switches: int
    new_ids: int
    wrong_ids: int


class _Detector:
    """Stands for the detector: metric II asks it for the size of its input only."""

    input_px = (640, 480)


def rows(say: Callable[[str], None], run_s: float = RUN_S, seeds: int = SEEDS) -> list[Row]:
    """Return people.switches and the figures beside it."""
    kinds = [(2, "sway", "sticky"), (2, "sway", "nearest"), (3, "cross", "sticky")]
    trials = [Trial(*kind, seed) for kind, seed in itertools.product(kinds, range(seeds))]
    with ProcessPoolExecutor(_PROCESSES) as pool:
        outcomes = list(pool.map(run, trials, itertools.repeat(run_s)))
    minutes = seeds * run_s / 60.0
    figures = {}
    for kind in kinds:
        own = [o for t, o in zip(trials, outcomes, strict=True) if (t.count, t.motion, t.policy) == kind]
        figures[kind] = [sum(getattr(o, name) for o in own) / minutes for name in ("switches", "new_ids", "wrong_ids")]
        say(f"{kind[0]} persons {kind[1]}, {kind[2]}: switches, new ids, wrong ids a minute {figures[kind]}")
    sticky, nearest, crossing = (figures[kind] for kind in kinds)
    return [
        Row("people.switches", sticky[0], "1/min", "policy nearest", nearest[0]),
        Row("people.switches.cross", crossing[0], "1/min"),
        Row("people.new_ids", sticky[1], "1/min, two sway"),
        Row("people.new_ids.cross", crossing[1], "1/min, three cross"),
        Row("people.wrong_ids", sticky[2] + crossing[2], "1/min"),
    ]


def run(trial: Trial, run_s: float = RUN_S) -> Outcome:
    """Run metric II before the persons of a trial, and compare its choice with the truth."""
    world = {"persons.count": trial.count, "persons.motion": trial.motion, "world.seed": trial.seed}
    simulator = Simulator(SimParameters.ideal({**world, "target.z_m": -5.0}))
    rig, random = default_rig(), np.random.default_rng(trial.seed)
    kinematics = Kinematics(rig)
    cameras = CameraModel(rig.left_camera), CameraModel(rig.right_camera)
    parameters = BoxMetricParameters()
    parameters = replace(
        parameters,
        follow=parameters.follow.replaced(policy=trial.policy),
        measurement=parameters.measurement.replaced(refine=False),
    )
    measurement = BoxMeasurement(parameters, kinematics, _Detector())  # type: ignore[arg-type]
    eyes, chosen = np.array([0.0, 0.06, 0.0]), 0
    ledger = _Ledger()
    while simulator.time_s < run_s:
        simulator.advance(_PERIOD_S)
        wanted = kinematics.gaze_for_point(simulator.person_place_m(chosen))
        eyes += _FOLLOWED_SHARE * (np.array([wanted.pan_left_rad, wanted.pan_right_rad, wanted.tilt_rad]) - eyes)
        simulator.set_head(dict(zip(("pan_left", "pan_right", "tilt"), eyes.tolist(), strict=True)))
        images = simulator.view("left"), simulator.view("right")
        seen = [_detected(simulator, eye, random) for eye in EYES]
        reported = EyeAngles(*(eyes + random.uniform(-_JOINT_ERROR_RAD, _JOINT_ERROR_RAD, 3)).tolist())
        result = measurement.measure_detections(images, (seen[0][0], seen[1][0]), simulator.time_s, reported, cameras)
        chosen = ledger.add(result, (seen[0][1], seen[1][1]), chosen)
    simulator.close()
    return Outcome(ledger.switches, ledger.new_ids, ledger.wrong_ids)


class _Ledger:
    """Counts changes of the choice and of ids. Whose a box is comes with it, -1 for one of nothing."""

    def __init__(self) -> None:
        self.switches = self.new_ids = self.wrong_ids = 0
        self._last: int | None = None
        self._id_of: dict[int, int] = {}
        self._person_of: dict[int, int] = {}

    def add(self, result: BoxVergenceResult, owners: tuple[dict[Any, int], dict[Any, int]], chosen: int) -> int:
        """Add a pair and return the chosen person, the one before while none is."""
        for one in result.objects:
            person = self._person(one.boxes, owners)
            if person < 0:
                continue
            known = self._person_of.setdefault(one.object_id, person)
            self.wrong_ids += known != person
            self._person_of[one.object_id] = person
            before = self._id_of.setdefault(person, one.object_id)
            self.new_ids += before != one.object_id
            self._id_of[person] = one.object_id
        person = -1 if result.target is None else self._person(result.target.boxes, owners)
        if person < 0:
            return chosen
        self.switches += self._last not in (None, person)
        self._last = person
        return person

    @staticmethod
    def _person(boxes: Any, owners: tuple[dict[Any, int], dict[Any, int]]) -> int:
        whose = [owner.get(b.xyxy_px, -1) for owner, b in zip(owners, (boxes.left, boxes.right), strict=True) if b]
        return whose[0] if len(set(whose)) == 1 else -1


def _detected(simulator: Simulator, eye: str, random: np.random.Generator) -> tuple[Detections, dict[Any, int]]:
    """Return what a detector would find in an eye's image, and whose each box is."""
    boxes = {i: simulator.true_box(eye, PERSONS[i]) for i in range(simulator.parameters.persons.count)}
    named = {i: box for i, box in boxes.items() if box is not None}
    sides, whose = [], []
    for number, box in sorted(named.items()):
        nearer = [o for n, o in named.items() if simulator.person_place_m(n)[0] < simulator.person_place_m(number)[0]]
        if random.random() < _MISSED or max((_covered(box, o) for o in nearer), default=0.0) > _HIDDEN_SHARE:
            continue
        sides.append(
            np.array([box.x_min_px, box.y_min_px, box.x_max_px, box.y_max_px]) + random.normal(0, _NOISE_PX, 4)
        )
        whose.append(number)
    if random.random() < _FALSE:
        x, y = random.uniform((60, 60), (500, 300))
        sides.append(np.array([x, y, x + 70, y + 95]))
        whose.append(-1)
    xyxy = np.array(sides).reshape(-1, 4)
    scores = np.clip(random.normal(0.85, 0.05, len(sides)), 0.0, 1.0)
    found = make_detections(xyxy, scores, np.zeros(len(sides), np.int64), (PERSON_CLASS,), (640, 480))
    order = np.argsort(-scores, kind="stable")
    return found, {box.xyxy_px: whose[i] for box, i in zip(found.boxes(), order, strict=True)}


def _covered(box: TrueBox, other: TrueBox) -> float:
    """Return the share of a box that another covers."""
    width = min(box.x_max_px, other.x_max_px) - max(box.x_min_px, other.x_min_px)
    height = min(box.y_max_px, other.y_max_px) - max(box.y_min_px, other.y_min_px)
    whole = (box.x_max_px - box.x_min_px) * (box.y_max_px - box.y_min_px)
    return max(width, 0.0) * max(height, 0.0) / max(whole, 1e-9)
