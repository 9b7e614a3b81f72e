"""The shipped metric and controller before any lockstep world, in simulated time: no nodes, no sleeping.

Images, joint reports and results take as long as through the running nodes: `camera.latency_s` from an exposure to its
publication, `processing_s` for the metric, 2 ms for a joint report.
"""

import heapq
import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from vergence.body import JointAngles
from vergence.pair_metric import PairMetric
from vergence_gaze.control.controller import GazeController
from vergence_gaze.estimation.observations import JointReport, Observation
from vergence_gaze.goals.goal import Goal, GoalKind
from vergence_gaze.parameter_groups import gaze_parameters
from vergence_gaze.parameters import GazeParameters
from vergence_metric.measurement.parameters import PairMeasurementParameters
from vergence_metric.pairs.pairing import Pair
from vergence_rig.camera import CameraModel
from vergence_rig.eye_image import eye_images
from vergence_rig.rig import JOINT_NAMES, Rig
from vergence_sim.real_time import Schedule
from vergence_sim.world import EYES, World

Array = npt.NDArray[np.float64]
Image = npt.NDArray[np.uint8]

CONTROL_PERIOD_S = 0.02
PROCESSING_S = 0.030
JOINT_REPORT_S = 0.002
_CLOCK_START_S = 100.0
"""Time 0 of the world on the clock of the stamps: a stamp of zero would mean "none"."""


@dataclass
class Trace:
    """One step of control after another since the click: times [s], errors [deg], and what the controller reported."""

    time_s: list[float] = field(default_factory=list)
    aside_deg: list[float] = field(default_factory=list)
    vergence_deg: list[float] = field(default_factory=list)
    verged: list[bool] = field(default_factory=list)
    phase: list[str] = field(default_factory=list)
    reason: list[str] = field(default_factory=list)
    first_result_s: float = math.inf
    start_errors_rad: tuple[float, float, float] = (math.nan, math.nan, math.nan)

    @property
    def largest_deg(self) -> Array:
        """The largest of the errors in version, tilt and vergence (n,)."""
        return np.maximum(np.abs(self.aside_deg), np.abs(self.vergence_deg))


class Clickable(Protocol):
    """A point of a world that can be clicked on in the left eye's image, and whose truth is known."""

    def left_pixel(self) -> tuple[float, float]:
        """Return the pixel (x, y), as the lens distorts it, at which the left eye sees it now."""

    def errors_rad(self) -> tuple[float, float, float]:
        """Return how much vergence, version and tilt are short of it now [rad]."""


class Lockstep:
    """World, metric and controller on one clock. `advance_to` lets all of them run; `on_step` sees every command."""

    def __init__(self, world: World, rig: Rig, parameters: GazeParameters | None = None) -> None:
        self.world = world
        self.controller = GazeController(rig, parameters or gaze_parameters(), CONTROL_PERIOD_S)
        # Without a calibration the nodes take rig.yaml's cameras.
        left, right = (CameraModel(world.calibrations[eye] or rig.camera(eye == "left")) for eye in EYES)
        self.images = eye_images(rig, (left, right))
        """Both eyes' images, as their camera_info and the rig describe them."""
        self.metric = metric_of(rig, world)
        self.on_step: Callable[[Any], None] = lambda command: None
        self.newest_exposure_s = -math.inf
        """When the left image of the newest pair that was measured was exposed."""
        self.newest_published_s = math.nan
        """When the newest left image that was published was exposed."""
        self._schedule = Schedule(world.parameters, world.time_s)
        self._frames: dict[str, list[tuple[float, Image]]] = {eye: [] for eye in EYES}
        self._arrivals: list[tuple[float, int, list[Observation], float]] = []
        self._order = itertools.count()
        self._next_step_s = world.time_s + 0.5 * CONTROL_PERIOD_S

    def advance_to(self, until_s: float) -> None:
        """Let everything happen that is due until then."""
        while min(self._schedule.next_due_s(), self._next_step_s) <= until_s:
            if self._schedule.next_due_s() <= self._next_step_s:
                self._world_event()
            else:
                self._control()
                self._next_step_s += CONTROL_PERIOD_S
        self.world.advance_to(until_s)

    def click(self, pixel: tuple[float, float]) -> int:
        """Ask the controller to look at a pixel (x, y) of the newest left image that was published."""
        x, y = self.images[0].undistort([pixel])[0]
        goal = Goal(
            GoalKind.PIXEL,
            left_eye=True,
            left_xy=(float(x), float(y)),
            stamp_s=clock_s(self.newest_published_s),
        )
        return self.controller.look_at(goal, clock_s(self.world.time_s))

    def _world_event(self) -> None:
        due_s = self._schedule.next_due_s()
        event = self._schedule.pop(due_s)
        world = self.world
        if event.kind == "publish":
            self._publish(event.eye, *event.payload)  # type: ignore[misc]
            return
        world.advance_to(event.due_s)
        if event.kind == "joints":
            report = world.joint_states()
            self.metric.add_joints(
                JointAngles(_ns(clock_s(event.due_s)), np.array([report[name] for name in JOINT_NAMES]))
            )
            self._arrive(event.due_s + JOINT_REPORT_S, [JointReport(clock_s(event.due_s), dict(report))])
            return
        publish_s = event.due_s + world.parameters.camera.latency_s
        self._schedule.publish(event.eye, publish_s, (event.due_s, world.expose(event.eye)))

    def _publish(self, eye: str, exposed_s: float, develop: Callable[[], Image]) -> None:
        self._frames[eye].append((exposed_s, develop()))
        if eye == "left":
            self.newest_published_s = exposed_s
        if not all(self._frames.values()):
            return
        (left_s, left), (right_s, right) = (self._frames[e].pop(0) for e in EYES)
        seen = self.metric.observe(pair_of(left, right, left_s, right_s))
        published_s = max(left_s, right_s) + self.world.parameters.camera.latency_s
        self._arrive(published_s + PROCESSING_S, seen, left_s)

    def _arrive(self, due_s: float, seen: list[Observation], exposed_s: float = -math.inf) -> None:
        heapq.heappush(self._arrivals, (due_s, next(self._order), seen, exposed_s))

    def _control(self) -> None:
        now_s, arrived = self._next_step_s, []
        self.world.advance_to(now_s)
        while self._arrivals and self._arrivals[0][0] <= now_s:
            _, _, seen, exposed_s = heapq.heappop(self._arrivals)
            arrived += seen
            self.newest_exposure_s = max(self.newest_exposure_s, exposed_s)
        command = self.controller.step(clock_s(now_s), arrived)
        if command.track_request is not None:
            self.metric.request_track(command.track_request)
        if command.joints_rad is not None:
            self.world.command(dict(zip(JOINT_NAMES, command.joints_rad.tolist(), strict=True)), now_s)
        self.on_step(command)


def record(
    lockstep: Lockstep,
    point: Clickable,
    duration_s: float,
    rest_s: float,
    also: Callable[[Any], None] = lambda command: None,
) -> Trace:
    """Click on a point as the left eye sees it now and follow what happens; the trace ends after `duration_s`.

    It ends before that once `verged` has stood for `rest_s`. `also` is called with every command too.
    """
    world, trace = lockstep.world, Trace()
    began_s = world.time_s
    trace.start_errors_rad = point.errors_rad()
    verged_since_s = math.inf

    def note(command: Any) -> None:
        nonlocal verged_since_s
        now_s, report = world.time_s - began_s, command.report
        vergence, version, tilt = (math.degrees(error) for error in point.errors_rad())
        if math.isinf(trace.first_result_s) and lockstep.newest_exposure_s >= began_s:
            trace.first_result_s = now_s
        trace.time_s.append(now_s)
        trace.aside_deg.append(max(abs(version), abs(tilt)))
        trace.vergence_deg.append(vergence)
        trace.verged.append(bool(report.verged))
        trace.phase.append(report.phase.name.lower())
        trace.reason.append(report.reason)
        also(command)
        verged_since_s = min(verged_since_s, now_s) if report.verged else math.inf

    lockstep.click(point.left_pixel())
    lockstep.on_step = note
    while world.time_s < began_s + duration_s - 1e-9 and world.time_s - began_s - verged_since_s < rest_s:
        lockstep.advance_to(world.time_s + CONTROL_PERIOD_S)
    return trace


def metric_of(rig: Rig, world: World) -> PairMetric:
    """Return the metric with its parameters as shipped, for the cameras of a world."""
    return PairMetric(rig, calibrated(world), PairMeasurementParameters())


def calibrated(world: World) -> tuple[CameraModel | None, CameraModel | None]:
    """Return the cameras of a world, None for one that is not calibrated."""
    left, right = (world.calibrations[eye] for eye in EYES)
    return None if left is None else CameraModel(left), None if right is None else CameraModel(right)


def pair_of(left: Image, right: Image, left_s: float, right_s: float) -> Pair[Image]:
    """Return a pair of images that were exposed at these times of the world [s]."""
    return Pair(left, right, _ns(clock_s(left_s)), _ns(clock_s(right_s)))


def clock_s(world_s: float) -> float:
    """Return a time of the world on the clock of the stamps [s]."""
    return _CLOCK_START_S + world_s


def _ns(stamp_s: float) -> int:
    return round(stamp_s * 1e9)
