"""POINT goals of printed, identified heads by joints alone: no image is taken, so vision corrects nothing."""

import math
from dataclasses import dataclass, replace

import numpy as np

from bench.gaze_scenarios import place
from bench.photos_lockstep import CONTROL_PERIOD_S, clock_s
from vergence_gaze.control.controller import GazeController
from vergence_gaze.estimation.observations import JointReport
from vergence_gaze.goals.goal import Goal, GoalKind
from vergence_gaze.parameter_groups import gaze_parameters
from vergence_rig.rig import JOINT_NAMES, Rig
from vergence_rig.servo import IDEAL
from vergence_sim.parameters import SimParameters
from vergence_sim.printed_head import printed_head
from vergence_sim.simulator import Simulator

POINTS_OF_A_HEAD = 10
_AWAKE_S, _TURNING_S = 0.3, 1.5


@dataclass(frozen=True)
class PointTrial:
    """POINT goals of one head, described by `rig` (None: as it is).

    The tilt's zero cannot be found by looking, as the whole world may be tilted instead: the true one is given.
    """

    head: int
    rig: Rig | None = None


def angles_deg(trial: PointTrial) -> list[float]:
    """Return, for each goal, the larger of the angles between the point and both foveas once the joints rest [deg]."""
    head = printed_head(trial.head).with_servos(IDEAL)
    rig = head if trial.rig is None else _with_tilt_zero(trial.rig, head.tilt.zero_rad).with_servos(IDEAL)
    random = np.random.default_rng([trial.head, 43])
    simulator = Simulator(SimParameters.of({}), rig, render=False, head=head)
    found = []
    for _ in range(POINTS_OF_A_HEAD):
        distance_m = math.exp(random.uniform(math.log(0.3), math.log(1.5)))
        azimuth, elevation = math.radians(random.uniform(-30.0, 30.0)), math.radians(random.uniform(-15.0, 15.0))
        point_m = place(distance_m, azimuth, elevation)
        _turn_to(simulator, rig, (float(point_m[0]), float(point_m[1]), float(point_m[2])))
        found.append(math.degrees(max(simulator.angles_to_foveas(point_m))))
    return found


def _with_tilt_zero(rig: Rig, zero_rad: float) -> Rig:
    return replace(rig, joints=replace(rig.joints, tilt=replace(rig.tilt, zero_rad=zero_rad)))


def _turn_to(simulator: Simulator, rig: Rig, point_m: tuple[float, float, float]) -> None:
    controller = GazeController(rig, gaze_parameters(), CONTROL_PERIOD_S)
    began_s, asked = simulator.time_s, False
    while simulator.time_s < began_s + _AWAKE_S + _TURNING_S:
        simulator.advance(CONTROL_PERIOD_S)
        now_s = clock_s(simulator.time_s)
        if not asked and simulator.time_s >= began_s + _AWAKE_S:
            controller.look_at(Goal(GoalKind.POINT, point_m=point_m), now_s)
            asked = True
        command = controller.step(now_s, [JointReport(now_s, simulator.joint_states())])
        if command.joints_rad is not None:
            simulator.command(dict(zip(JOINT_NAMES, command.joints_rad.tolist(), strict=True)))
