"""Runs one controller on one head in lockstep and returns its trace as arrays."""

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from bench.gaze_trace import Trace
from bench.heads import identified, joints_of
from bench.real_servos import SERVO_SPREAD, real_servo
from vergence_gaze.control.controller import GazeController
from vergence_gaze.estimation.observations import BoxSighting, EyeRotationObservation, Observation
from vergence_gaze.goals.goal import Goal, GoalKind
from vergence_gaze.parameter_groups import gaze_parameters
from vergence_gaze.phases import Phase
from vergence_gaze.testing.fake_head import TARGET_ID, TICK_S, FakeHead, VisionModel
from vergence_rig.camera import CameraModel
from vergence_rig.eye_image import eye_images
from vergence_rig.rig import Rig, default_rig
from vergence_rig.servo import IDEAL, MG995, SG90, ServoSpec
from vergence_sim.parameters import SimParameters
from vergence_sim.simulator import Simulator

Array = npt.NDArray[np.float64]

SERVOS: Mapping[str, ServoSpec] = {"ideal": IDEAL, "sg90": SG90, "mg995": MG995}
CONTROL_TICKS = 6
ENCODER_TICKS = 60
ENCODER_LATENCY_TICKS = 30

Encoder: TypeAlias = Callable[[FakeHead], EyeRotationObservation | None]
"""What the visual encoder says of a head as it stands now, if anything."""


def tolerance_deg(servo: str) -> float:
    """The true error within which the eyes are verged: 0.25 degree for ideal servos, the dead band for others."""
    return 0.25 if servo == "ideal" else math.degrees(SERVOS[servo].dead_band_rad)


@dataclass(frozen=True)
class Scenario:
    """A target (seconds to (3,) [m]), the eyes' angles at the start, how long, and how the target is given.

    `given` is "pairs", stereo pixel pairs at frame rate; "boxes", the detector's alone; "class", those and the tracker;
    "click" or "two_clicks", one pixel or one pair of them and then the tracker.
    """

    target: Callable[[float], Array]
    start_rad: Mapping[str, float]
    duration_s: float
    given: str = "pairs"
    seed: int = 0
    visible: Callable[[float], bool] = lambda time_s: True
    encoder: Encoder | None = None
    mistaken: Mapping[str, Callable[[float], Array | None]] = field(default_factory=dict)


@dataclass(frozen=True)
class Setting:
    """Servos, latency and law of a run."""

    law: str = "predictive"
    servo: str = "sg90"
    latency_ms: int = 60

    @property
    def suffix(self) -> str:
        """What the row's name gets: nothing for the default."""
        return "" if self == Setting() else f".{self.law}.{self.servo}.{self.latency_ms}"


@dataclass
class Realism:
    """Seeded differences between the head as described and as it is; all zero is the ideal head."""

    servo_spread: float = SERVO_SPREAD
    noise_px: float = 0.4
    stamp_error_s: float = 0.003
    frame_rate_hz: float = 30.0
    box: Mapping[str, float] = field(
        default_factory=lambda: {"rate_hz": 15.0, "latency_s": 0.04, "noise_px": 1.2, "surface_px": 0.4}
    )


def seeing_of(scenario: Scenario, setting: Setting, realism: Realism, random: np.random.Generator) -> VisionModel:
    """Return how the head sees in this run."""
    boxes = scenario.given in ("boxes", "pairs", "class")
    frame_rate = scenario.given == "pairs"
    frame_ticks = round(1.0 / (TICK_S * realism.frame_rate_hz))
    return VisionModel(
        latency_s=setting.latency_ms * 1e-3,
        frame_ticks=frame_ticks,
        skew_ticks=int(random.integers(0, 6)),
        noise_px=realism.noise_px,
        stamp_error_s=random.uniform(-realism.stamp_error_s, realism.stamp_error_s),
        track=not boxes or scenario.given == "class",
        boxes=boxes,
        box_frame_ticks=frame_ticks if frame_rate else round(300.0 / realism.box["rate_hz"]),
        box_latency_s=setting.latency_ms * 1e-3 + (0.0 if frame_rate else realism.box["latency_s"]),
        box_noise_px=realism.noise_px if frame_rate else realism.box["noise_px"],
        surface_noise_px=math.nan if frame_rate else realism.box["surface_px"],
        box_miss_share=0.0 if frame_rate else 0.05,
    )


@lru_cache(maxsize=1)
def world() -> Simulator:
    """One world serves every run: only where its hinges are set matters, and that is set anew at every look."""
    rig = default_rig()
    return Simulator(SimParameters(), rig, render=False)


class SimulatedHead(FakeHead):
    """The fake head with the lockstep simulator's kinematics and mounts: what is seen and true comes from MuJoCo."""

    def __post_init__(self) -> None:
        self._simulator = world()
        self.built = self._simulator.head.real
        super().__post_init__()
        cameras = CameraModel(self.rig.left_camera), CameraModel(self.rig.right_camera)
        self._images = eye_images(self.rig, cameras)
        self._posed_at = math.nan

    def project(self, point_m: Array, left: bool) -> Array:
        """Return normalised coordinates (2,) of a point in an eye's ideal image, by the simulator's mounted cameras."""
        self._pose()
        eye = "left" if left else "right"
        pixel = self._simulator.lenses[eye].distorted(self._simulator.project(eye, point_m))
        return np.asarray(self._images[not left].undistort(pixel))[0]

    def true_errors_rad(self, object_id: int = TARGET_ID) -> Array:
        """Return (version, vergence, tilt) to the target, the one object there is, minus the true ones (3,)."""
        self._pose()
        vergence, version, tilt = self._simulator.errors_to(self.target(self.time_s))
        return np.array([version, vergence, tilt])

    def _pose(self) -> None:
        if self._posed_at != self.time_s:
            self._simulator.set_head({name: plant.true_rad for name, plant in self._plants.items()})
            self._posed_at = self.time_s


def run(
    scenario: Scenario,
    setting: Setting,
    realism: Realism | None = None,
    parameters: Mapping[str, Any] | None = None,
) -> Trace:
    """Run one scenario and return its trace."""
    realism = Realism() if realism is None else realism
    random = np.random.default_rng(scenario.seed + 7919)
    servo = SERVOS[setting.servo]
    rig: Rig = identified().with_servos(servo)
    head = SimulatedHead(
        rig,
        scenario.target,
        seeing_of(scenario, setting, realism, random),
        scenario.seed,
        joints_of(world().head.real, scenario.start_rad),
        lambda time_s: time_s >= 0.0 and scenario.visible(time_s),
        scenario.mistaken,
        {name: real_servo(servo, realism.servo_spread, random) for name, _ in rig.joints.items()},
        # The target appears at 0; the head has been awake for a while by then, at any phase of its frames.
        begin_s=-TICK_S * int(random.integers(90, 120)),
    )
    values = {"law": setting.law, **dict(parameters or {})}
    controller = GazeController(rig, gaze_parameters(values), CONTROL_TICKS * TICK_S)
    return _loop(head, controller, scenario)


def _loop(head: FakeHead, controller: GazeController, scenario: Scenario) -> Trace:
    arrived: list[Observation] = []
    samples: list[tuple[float, Array, Array, Array, bool, int, tuple[float, float, float], float]] = []
    first_result_s, way_s, ticks, begun = math.inf, 0.0, 0, False
    reading: EyeRotationObservation | None = None
    while head.time_s < scenario.duration_s:
        arrived += head.advance()
        ticks += 1
        if ticks % CONTROL_TICKS:
            continue
        now_s = head.time_s
        if now_s < 0.0:
            controller.step(now_s, arrived)
            arrived = []
            continue
        if not begun:
            _begin(controller, scenario, head)
            begun = True
        if math.isinf(first_result_s) and any(_shows_target(observation) for observation in arrived):
            first_result_s = now_s
            way_s = travel_s(head.true_errors_rad(), head.rig)
        if scenario.encoder is not None and ticks % ENCODER_TICKS == 0:
            reading = scenario.encoder(head)
        if reading is not None and ticks % ENCODER_TICKS == ENCODER_LATENCY_TICKS:
            arrived.append(reading)
            reading = None
        began = time.perf_counter()
        command = controller.step(now_s, arrived)
        took_s = time.perf_counter() - began
        arrived = []
        head.execute(command)
        report = command.report
        position = report.target
        samples.append(
            (
                now_s,
                np.degrees(head.true_errors_rad()),
                np.degrees(head.true_rad),
                np.degrees(command.joints_rad) if command.joints_rad is not None else np.full(3, math.nan),
                report.verged,
                int(report.phase),
                (position.distance_m, position.low_m, position.high_m),
                took_s,
            )
        )
    columns = list(zip(*samples, strict=True))
    return Trace(
        time_s=np.array(columns[0]),
        errors_deg=np.array(columns[1]),
        joints_deg=np.array(columns[2]),
        commands_deg=np.array(columns[3]),
        verged=np.array(columns[4]),
        phase=np.array(columns[5]),
        distance_m=np.array(columns[6]),
        step_s=np.array(columns[7]),
        first_result_s=first_result_s,
        travel_s=way_s,
    )


def _begin(controller: GazeController, scenario: Scenario, head: FakeHead) -> None:
    if scenario.given in ("click", "two_clicks"):
        left, right = (head.project(scenario.target(head.time_s), eye).tolist() for eye in (True, False))
        goal = Goal(GoalKind.PIXEL, left_xy=tuple(left), time_limit_s=600.0)
        if scenario.given == "two_clicks":
            goal = Goal(GoalKind.STEREO_PIXEL, left_xy=tuple(left), right_xy=tuple(right), time_limit_s=600.0)
    else:
        goal = Goal(GoalKind.CLASS, class_name="target", time_limit_s=600.0)
    controller.look_at(goal, head.time_s)


def _shows_target(observation: Observation) -> bool:
    return isinstance(observation, BoxSighting) and observation.usable


def travel_s(errors_rad: Array, rig: Rig) -> float:
    """Return how long the servos need at full speed, all at once, over errors of version, vergence and tilt (3,)."""
    version, vergence, tilt = errors_rad
    ways = np.abs([version - 0.5 * vergence, version + 0.5 * vergence, tilt])
    speeds = np.array([joint.scale * joint.servo.speed_rad_s for _, joint in rig.joints.items()])
    return float((ways / speeds).max())


FIXATE = int(Phase.FIXATE)
