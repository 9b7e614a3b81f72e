"""Runs scenarios on a simulated head of processes, every node with its shipped YAML, and returns their traces."""

import contextlib
import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from sensor_msgs.msg import JointState

from bench.gaze_runs import Scenario, Trace, travel_s
from bench.heads import identified, simulated
from bench.results import OUT_DIR
from vergence_bringup.demo.ros.recorder import Recorder, Stamped
from vergence_bringup.demo.ros.stage import RoomStage, class_goal
from vergence_bringup.ros.processes import ProcessGroup
from vergence_bringup.ros.simulated_head import simulated_head
from vergence_common.domains import own_domain
from vergence_common.stamps import to_seconds
from vergence_msgs.action import LookAt
from vergence_msgs.msg import BoxVergence
from vergence_rig.rig import JOINT_NAMES, Rig
from vergence_rig.rig_file import write_rig

Array = npt.NDArray[np.float64]
Point = Sequence[float] | Array

SERVO = "sg90"
TARGET = "cube"
_LIMIT_S = 10.0


class ProcessHead:
    """One head at a time, as it is built; `open_head` makes it. Times of traces count from when the goal was sent."""

    def __init__(self, recorder: Recorder, nodes: ProcessGroup, built: Rig) -> None:
        self._recorder, self._check_alive, self._built = recorder, nodes.check, built
        self._stage = RoomStage(recorder, nodes.check, ("target", "occluder"))
        self._joints = recorder.record(JointState, "ground_truth/joint_states", nodes.check)
        self._stage.wait_until_ready()
        recorder.wait_for("ground_truth/joint_states", lambda: self._joints, 40.0, nodes.check)

    def at_rest(self, scenario: Scenario) -> Trace:
        """Run a scenario with a static target, given as the scenario says, from its start pose."""
        self._prepare(scenario)
        goal = class_goal(TARGET, _LIMIT_S) if scenario.given == "class" else self._two_clicks()
        began_s, mark = self._recorder.now_s(), len(self._recorder.boxes)
        self._recorder.look_at(goal, self._check_alive)
        self._run_until(began_s + scenario.duration_s)
        first_result_s = 0.0
        if scenario.given == "class":
            arrivals = (
                e.arrival_s - began_s for e in self._recorder.boxes[mark:] if e.message.status == BoxVergence.STATUS_OK
            )
            first_result_s = next(arrivals, math.inf)
        return self._trace(began_s, scenario.duration_s, first_result_s)

    def hidden(self, scenario: Scenario, from_s: float, until_s: float) -> Trace:
        """Run a scenario with the occluder before the target, at 0.6 of its distance, for a while."""
        self._prepare(scenario)
        began_s = self._recorder.now_s()
        self._recorder.look_at(class_goal(TARGET, _LIMIT_S), self._check_alive)
        self._run_until(began_s + from_s)
        self._stage.put("occluder", 0.6 * np.asarray(scenario.target(0.0)))
        self._run_until(began_s + until_s)
        self._stage.hide("occluder")
        self._run_until(began_s + scenario.duration_s)
        return self._trace(began_s, scenario.duration_s, math.nan)

    def pursuing(self, scenario: Scenario, velocity_m_s: Point, moves_from_s: float) -> Trace:
        """Run a scenario whose target moves at a constant velocity from `moves_from_s` to the end."""
        self._prepare(scenario)
        self._recorder.look_at(class_goal(TARGET, _LIMIT_S), self._check_alive)
        self._stage.settle()
        x, y, z = (float(value) for value in velocity_m_s)
        ramp = {"motion.kind": "ramp", "motion.x_m": x, "motion.y_m": y, "motion.z_m": z}
        began_s = self._recorder.now_s() - moves_from_s
        self._recorder.set_parameters("sim_node", ramp, self._check_alive)
        self._run_until(began_s + scenario.duration_s)
        trace = self._trace(began_s, scenario.duration_s, math.nan)
        self._stage.hide("target")
        self._recorder.set_parameters("sim_node", {"motion.kind": "static"}, self._check_alive)
        return trace

    def latency_s(self) -> float:
        """Return how old a pair is when its metric arrives, the median of all that came."""
        ages = [e.arrival_s - to_seconds(e.message.header.stamp) for e in self._recorder.edges]
        return float(np.median(ages))

    def _prepare(self, scenario: Scenario) -> None:
        """Move the eyes to the start without a target, then place the target and wait for the ground truth."""
        recorder, pose = self._recorder, scenario.start_rad
        self._stage.clear()
        left, right = pose["pan_left"], pose["pan_right"]
        self._stage.send_eyes(0.5 * (left + right), right - left, pose["tilt"])
        self._stage.put("target", scenario.target(0.0))
        shown_s = recorder.now_s()
        recorder.wait_for(
            "the truth of the target in its place",
            lambda: to_seconds(recorder.truths[-1].message.header.stamp) > shown_s + 0.02,
            5.0,
            self._check_alive,
        )

    def _two_clicks(self) -> LookAt.Goal:
        """Return the goal of clicks on the target in both images."""
        truth = self._recorder.truths[-1].message
        goal = LookAt.Goal(kind=LookAt.Goal.STEREO_PIXEL, time_limit_s=_LIMIT_S)
        goal.header.stamp = truth.header.stamp
        goal.left_x_px, goal.left_y_px = float(round(truth.left_x_px)), float(round(truth.left_y_px))
        goal.right_x_px, goal.right_y_px = float(round(truth.right_x_px)), float(round(truth.right_y_px))
        return goal

    def _run_until(self, time_s: float) -> None:
        self._recorder.settle(time_s - self._recorder.now_s(), self._check_alive)

    def _trace(self, began_s: float, duration_s: float, first_result_s: float) -> Trace:
        """Return what happened, sampled at the controller's messages."""
        recorder = self._recorder
        states = [e for e in recorder.states if 0.0 <= e.arrival_s - began_s <= duration_s]
        time_s = np.array([entry.arrival_s - began_s for entry in states])
        joints = _at(time_s, began_s, self._joints, lambda message: self._built.eye_angles(_joints_of(message)))
        wanted = _at(time_s, began_s, recorder.truths, _wanted_of)
        pans_left, pans_right, tilts = joints.T
        errors = wanted - np.column_stack([0.5 * (pans_left + pans_right), pans_right - pans_left, tilts])
        return Trace(
            time_s=time_s,
            errors_deg=np.degrees(errors),
            joints_deg=np.degrees(joints),
            commands_deg=np.full((time_s.size, 3), math.nan),
            verged=np.array([entry.message.verged for entry in states], np.bool_),
            phase=np.array([entry.message.phase for entry in states], np.int_),
            distance_m=np.array([_distance_of(entry.message) for entry in states]),
            step_s=np.full(time_s.size, math.nan),
            first_result_s=first_result_s,
            travel_s=self._travel_s(errors, time_s, first_result_s),
        )

    def _travel_s(self, errors_rad: Array, time_s: Array, first_result_s: float) -> float:
        """Return how long the servos need from where they are at the first result; NaN for none."""
        if not math.isfinite(first_result_s):
            return math.nan
        return travel_s(errors_rad[min(int(np.searchsorted(time_s, first_result_s)), time_s.size - 1)], self._built)


@contextlib.contextmanager
def open_head() -> Iterator[ProcessHead]:
    """Start a head of its own DDS domain and end it."""
    rig = identified()
    path = OUT_DIR / "gaze_graph_rig.yaml"
    write_rig(path, rig)
    with (
        own_domain() as domain,
        ProcessGroup(OUT_DIR / "gaze_graph_logs", {"ROS_DOMAIN_ID": str(domain)}) as nodes,
    ):
        for name, command in simulated_head(path, simulated_time=False, **{"head.camera_info": "none"}).items():
            nodes.start(name, command)
        recorder = Recorder(domain)
        try:
            yield ProcessHead(recorder, nodes, simulated(rig))
        finally:
            recorder.close()


def _at(time_s: Array, began_s: float, series: Sequence[Stamped], values_of: Any) -> Array:
    """Return a topic's values (n, k) at times, linear between its stamps."""
    lately = [e for e in series if e.arrival_s > began_s - 1.0]
    stamps = np.array([to_seconds(e.message.header.stamp) - began_s for e in lately])
    values = np.array([values_of(e.message) for e in lately])
    return np.column_stack([np.interp(time_s, stamps, column) for column in values.T])


def _joints_of(message: JointState) -> list[float]:
    angles = dict(zip(message.name, message.position, strict=True))
    return [angles[name] for name in JOINT_NAMES]


def _wanted_of(truth: Any) -> list[float]:
    """Return the version, vergence and tilt that fixate the target point, by the simulator's own kinematics."""
    return [
        0.5 * (truth.pan_left_rad + truth.pan_right_rad) + truth.version_error_rad,
        truth.pan_right_rad - truth.pan_left_rad + truth.vergence_error_rad,
        truth.tilt_rad + truth.elevation_error_rad,
    ]


def _distance_of(state: Any) -> tuple[float, float, float]:
    return state.distance_m, state.distance_low_m, state.distance_high_m
