"""A hundred thousand hostile observations, goals and stamps: every command keeps every limit, and nothing is raised."""

import math
from typing import Any

import numpy as np
import pytest

from vergence_gaze.control.controller import GazeController
from vergence_gaze.estimation.observations import (
    BoxSighting,
    EdgeContrast,
    EyeRotationObservation,
    JointReport,
    JointResolution,
    Observation,
    PointSighting,
    TrackSighting,
)
from vergence_gaze.goals.goal import Goal, GoalKind
from vergence_gaze.joints.limits import LONGEST_STEP_S, CommandLimits
from vergence_gaze.law_registry import law_names
from vergence_gaze.parameter_groups import gaze_parameters
from vergence_rig.rig import JOINT_NAMES, default_rig

ODD = (math.nan, math.inf, -math.inf, 1e300, -1e300, 0.0, 1e-300)


class Hostile:
    """Draws values that are sometimes sensible and sometimes anything but."""

    def __init__(self, seed: int) -> None:
        self._random = np.random.default_rng(seed)

    def value(self, scale: float, odd_share: float = 0.1) -> float:
        if self._random.random() < odd_share:
            return float(self._random.choice(ODD))
        return float(self._random.normal(0.0, scale))

    def stamp(self, now_s: float) -> float:
        kind = self._random.integers(0, 8)
        if kind == 0:
            return float(self._random.choice(ODD))
        if kind == 1:
            return now_s + float(self._random.normal(0.0, 100.0))
        return now_s - float(self._random.exponential(0.08))

    def flag(self) -> bool:
        return bool(self._random.random() < 0.8)

    def observation(self, now_s: float) -> Observation:
        kind, stamp, skew = self._random.integers(0, 9), self.stamp(now_s), self.value(0.01)
        v = self.value
        if kind <= 1:
            names = [*JOINT_NAMES, "elbow"]
            given = {str(name): v(0.3) for name in self._random.choice(names, self._random.integers(1, 5))}
            return JointReport(stamp, given)
        if kind <= 3:
            ids, goal = (int(self._random.integers(0, 4)) for _ in range(2))
            places = v(1.0), v(0.3), v(0.2), v(0.1), v(0.001), v(0.1)
            candidates = ((v(0.1), 0.5), (v(0.1), 0.4))
            return TrackSighting(
                stamp, skew, ids, *places, self.flag(), "", goal, ambiguous=self.flag(), candidates=candidates
            )
        if kind == 4:
            name = str(self._random.choice(["target", "", "cup"]))
            angles = v(0.4), v(0.3), v(0.4), v(0.3), v(0.1)
            return BoxSighting(stamp, skew, *angles, v(0.001), v(0.1), name, self.flag(), whole=self.flag())
        if kind == 5:
            return PointSighting(stamp, (v(1.0), v(0.5), v(0.5)), v(0.01))
        if kind == 6:
            return EyeRotationObservation(stamp, skew, v(0.1), v(0.01), self.flag())
        if kind == 7:
            names = [*JOINT_NAMES, "elbow"]
            steps = {str(name): v(0.01) for name in self._random.choice(names, self._random.integers(1, 5))}
            return JointResolution(stamp, steps)
        return EdgeContrast(stamp, abs(v(0.5)), v(3.0))

    def goal(self) -> Goal:
        v = self.value
        return Goal(
            GoalKind(int(self._random.integers(0, 6))),
            point_m=(abs(v(1.0)), v(0.3), v(0.3)),
            left_eye=self.flag(),
            left_xy=(v(0.3), v(0.2)),
            right_xy=(v(0.3), v(0.2)),
            depth_m=v(1.0, 0.5),
            version_rad=v(0.4),
            vergence_rad=abs(v(0.1)),
            tilt_rad=v(0.3),
            class_name=str(self._random.choice(["target", ""])),
            stamp_s=self.stamp(0.0),
            time_limit_s=abs(v(1.0)),
        )

    def elapsed_s(self) -> float:
        kind = self._random.integers(0, 30)
        if kind == 0:
            return float(self._random.choice([math.nan, math.inf, -0.1, 0.0, 5.0, -1000.0]))
        return 0.01


@pytest.mark.parametrize("law", law_names())
@pytest.mark.parametrize("seed", [1, 2])
def test_every_command_keeps_every_limit(law: str, seed: int) -> None:
    rig, hostile = default_rig(), Hostile(seed)
    limits = CommandLimits(rig)
    controller = GazeController(rig, gaze_parameters({"law": law, "start": "verge" if seed == 1 else "idle"}))
    good: dict[str, Any] = dict.fromkeys(JOINT_NAMES, 0.0)
    now_s, last, last_s = 100.0, None, math.nan
    for cycle in range(2500):
        now_s += 0.01
        step_s = hostile.elapsed_s()
        at_s = now_s if step_s == 0.01 else now_s + step_s
        observations: list[Observation] = [hostile.observation(now_s) for _ in range(5)]
        if cycle % 2:
            observations.append(JointReport(now_s, dict(good)))
        if cycle % 60 == 0:
            controller.look_at(hostile.goal(), at_s)
        if cycle % 211 == 0:
            controller.stop(at_s)
        sent = controller.step(at_s, observations).joints_rad
        if sent is None:
            last = None
            continue
        assert limits.allows(sent), (cycle, sent)
        if last is not None:
            passed_s = min(max(at_s - last_s, 0.0), LONGEST_STEP_S) if math.isfinite(at_s) else 0.0
            assert (np.abs(sent - last) <= limits.speed_rad_s * passed_s + 1e-9).all(), (
                cycle,
                last,
                sent,
                at_s - last_s,
            )
        if math.isfinite(at_s):
            last_s = at_s if not last_s - 1.0 <= at_s else max(at_s, last_s)
        last = sent
        good = dict(zip(JOINT_NAMES, sent.tolist(), strict=True))
