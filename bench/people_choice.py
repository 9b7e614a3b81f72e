"""How steadily one of several persons is chosen: boards with portraits that sway and cross in the simulated room.

The detector of persons is simulated (people_detector), metric II is the shipped one; the eyes follow the chosen person,
and their joints are off by their dead band.
"""

import itertools
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from bench.people_detector import NoDetector, detected
from bench.results import Row
from vergence_metric.boxes.measurement import BoxMeasurement
from vergence_metric.boxes.parameters import BoxMetricParameters
from vergence_metric.boxes.result import BoxVergenceResult
from vergence_rig.camera import CameraModel
from vergence_rig.geometry import EyeAngles
from vergence_rig.kinematics import Kinematics
from vergence_rig.rig import default_rig
from vergence_sim.parameters import SimParameters
from vergence_sim.simulator import Simulator
from vergence_sim.world import EYES

Array = npt.NDArray[np.float64]

RUN_S = 60.0
KINDS = ((2, "sway", "sticky"), (2, "sway", "nearest"), (3, "cross", "sticky"))
RUNS = (3, 1, 2)
"""Worlds of each kind of KINDS."""
_PERIOD_S = 0.1
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


def rows(say: Callable[[str], None], run_s: float = RUN_S) -> list[Row]:
    """Return people.switches and the figures beside it."""
    trials = [Trial(*kind, seed) for kind, runs in zip(KINDS, RUNS, strict=True) for seed in range(runs)]
    with ProcessPoolExecutor(_PROCESSES) as pool:
        outcomes = list(pool.map(run, trials, itertools.repeat(run_s)))
    figures = []
    for kind, runs in zip(KINDS, RUNS, strict=True):
        own = [o for t, o in zip(trials, outcomes, strict=True) if (t.count, t.motion, t.policy) == kind]
        counts = (sum(getattr(o, name) for o in own) for name in ("switches", "new_ids", "wrong_ids"))
        figures.append([60.0 * count / (runs * run_s) for count in counts])
        say(f"{kind[0]} persons {kind[1]}, {kind[2]}: switches, new ids, wrong ids a minute {figures[-1]}")
    sticky, nearest, crossing = figures
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
    measurement = BoxMeasurement(parameters, kinematics, NoDetector())  # type: ignore[arg-type]
    eyes, chosen = np.array([0.0, 0.06, 0.0]), 0
    ledger = _Ledger()
    while simulator.time_s < run_s:
        simulator.advance(_PERIOD_S)
        wanted = kinematics.gaze_for_point(simulator.person_place_m(chosen))
        eyes += _FOLLOWED_SHARE * (np.array([wanted.pan_left_rad, wanted.pan_right_rad, wanted.tilt_rad]) - eyes)
        simulator.set_head(dict(zip(("pan_left", "pan_right", "tilt"), eyes.tolist(), strict=True)))
        images = simulator.view("left"), simulator.view("right")
        seen = [detected(simulator, eye, random) for eye in EYES]
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
