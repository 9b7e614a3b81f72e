"""Clicks in rendered rooms by heads that are not as drawn: printed ones, identified or not, and odd principal points.

The lockstep runs of `photos_lockstep`, with one seeded head and room for several clicks. The truth is MuJoCo's.
"""

import math
from contextlib import closing
from dataclasses import dataclass, field, replace
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from bench.gaze_scenarios import in_view_start, place
from bench.geometry_heads import found_rig
from bench.geometry_identify import real_head
from bench.heads import joints_of
from bench.photos_lockstep import Lockstep, record
from bench.photos_scenes import PointOfRoom, settle
from bench.photos_trials import AWAKE_S
from vergence_rig.camera import CameraModel
from vergence_rig.eye_image import EyeImage, eye_images
from vergence_rig.kinematics import Kinematics
from vergence_rig.rig import CameraSpec, Rig, default_rig
from vergence_rig.servo import IDEAL, SG90
from vergence_sim.parameters import SimParameters
from vergence_sim.simulator import Simulator
from vergence_sim.world import EYES

Array = npt.NDArray[np.float64]

IDENTIFIED, FOUND, UNCALIBRATED, PRINCIPAL_POINT = "identified", "found", "uncalibrated", "principal_point"
"""What the graph is given: the head's own description; what identify found of it, its cameras without a calibration;
nothing (no calibration, the default rig.yaml); or the description of a head with principal points far off."""

NEAREST_M, FARTHEST_M = 0.3, 1.5
HEADS = 10
DURATION_S, REST_S = 4.0, 0.5
ON_TARGET_DEG, FALSE_DEG, FALSE_VERGENCE_DEG = 0.35, 1.0, 0.5
UNDESCRIBED_ZERO_SIGMA_RAD = 0.05
"""Of a pan's zero and its camera's yaw together, before identify: evenly up to 4 and 3 degrees."""
_PRINCIPAL_OFF_PX = 60.0
_AZIMUTH_RAD, _ELEVATION_RAD = math.radians(25.0), math.radians(12.0)
_IN_IMAGE_PX = 20.0
_THINGS = ("cube", "marker")


@dataclass(frozen=True)
class GeometryTrial:
    """A click; `head` seeds the head and its room, `number` the rest."""

    arm: str
    ideal_servos: bool
    head: int
    number: int


@dataclass(frozen=True)
class GeometryOutcome:
    """What came of a click, at its end: angles in degrees, distances in metres.

    `aside_deg` is the larger of the angles between the target point and each eye's fovea. `least_deg` is what remains
    of it with the best of joint angles: one tilt turns both eyes, and their lenses are not level. `seen_deg` is how far
    from the foveas that the graph was given the target appears to it: sideways in either eye, and up or down unless it
    lies above the one and below the other, as it does for cameras that are pitched apart.
    """

    trial: GeometryTrial
    distance_m: float
    verged: bool
    ever_verged: bool
    falsely_verged: bool
    aside_deg: float
    seen_deg: float
    stated_m: tuple[float, float, float]
    reason: str
    least_deg: float = 0.0

    @property
    def on_target(self) -> bool:
        """True if the eyes were declared verged at the end and the target appears at both foveas."""
        return self.verged and self.seen_deg <= ON_TARGET_DEG


def trials(arm: str, count: int, ideal_servos: bool = False) -> list[GeometryTrial]:
    """Return clicks over all heads, those of one head after one another."""
    of_a_head = -(-count // HEADS)
    return [GeometryTrial(arm, ideal_servos, number // of_a_head, number) for number in range(count)]


def head_of(trial: GeometryTrial) -> Rig:
    """Return the head that is simulated."""
    head = real_head(trial.head)
    head = head.with_servos(IDEAL) if trial.ideal_servos else head
    if trial.arm != PRINCIPAL_POINT:
        return head
    random = np.random.default_rng([trial.head, 41])
    return replace(
        head, left_camera=_off_centre(head.left_camera, random), right_camera=_off_centre(head.right_camera, random)
    )


def _off_centre(camera: CameraSpec, random: np.random.Generator) -> CameraSpec:
    x, y = random.uniform(-_PRINCIPAL_OFF_PX, _PRINCIPAL_OFF_PX, 2).tolist()
    return camera.replaced(cx_px=0.5 * (camera.width_px - 1) + x, cy_px=0.5 * (camera.height_px - 1) + y)


def rig_given(trial: GeometryTrial, head: Rig) -> Rig:
    """Return what the graph is given as rig.yaml."""
    if trial.arm == UNCALIBRATED:
        undescribed = replace(default_rig(), zero_sigma_rad=UNDESCRIBED_ZERO_SIGMA_RAD)
        return undescribed.with_servos(IDEAL) if trial.ideal_servos else undescribed
    if trial.arm == FOUND:
        found = found_rig(trial.head)
        return found.with_servos(IDEAL) if trial.ideal_servos else found
    return head if trial.ideal_servos else head.with_servos(SG90)


@dataclass
class _Watch:
    """Notes, at every step of control, what the verdict needs."""

    simulator: Simulator
    point_m: Array
    images: tuple[EyeImage, EyeImage]
    verged: list[bool] = field(default_factory=list)
    aside_deg: list[float] = field(default_factory=list)
    seen_deg: list[float] = field(default_factory=list)
    apart_deg: list[float] = field(default_factory=list)
    stated_m: tuple[float, float, float] = (math.nan, math.nan, math.nan)

    def __call__(self, command: Any) -> None:
        self.verged.append(bool(command.report.verged))
        self.aside_deg.append(math.degrees(max(self.simulator.angles_to_foveas(self.point_m))))
        (left_x, left_y), (right_x, right_y) = (
            np.degrees(np.arctan(image.undistort(pixel_of(self.simulator, eye, self.point_m))[0])).tolist()
            for eye, image in zip(EYES, self.images, strict=True)
        )
        below = 0.0 if left_y * right_y < 0 else min(abs(left_y), abs(right_y))
        self.seen_deg.append(max(abs(left_x), abs(right_x), below))
        self.apart_deg.append(abs(left_x - right_x))
        target = command.report.target
        self.stated_m = target.distance_m, target.low_m, target.high_m

    @property
    def falsely_verged(self) -> bool:
        """True if the eyes were declared verged at any time while the target appeared elsewhere."""
        off = (np.array(self.seen_deg) > FALSE_DEG) | (np.array(self.apart_deg) > FALSE_VERGENCE_DEG)
        return bool((np.array(self.verged) & off).any())


def run(trial: GeometryTrial) -> GeometryOutcome:
    """Run a trial."""
    cv2.setNumThreads(1)
    head = head_of(trial)
    rig = rig_given(trial, head)
    values: dict[str, Any] = {"seed": trial.number, "world.seed": trial.head % 8}
    values |= {"head.camera_info": "none"} if trial.arm in (FOUND, UNCALIBRATED) else {}
    random = np.random.default_rng([trial.number, 42])
    with closing(Simulator(SimParameters.of(values), rig, head=head)) as simulator:
        point_m = _placed(simulator, head, random)
        lockstep = Lockstep(simulator, rig)
        moment_s = float(random.uniform(0.0, 1.0 / simulator.parameters.camera.frame_rate_hz))
        lockstep.advance_to(simulator.time_s + AWAKE_S + moment_s)
        watch = _Watch(simulator, point_m, lockstep.images)
        trace = record(lockstep, PointOfRoom(simulator, point_m), DURATION_S, REST_S, watch)
        return GeometryOutcome(
            trial,
            float(np.linalg.norm(point_m)),
            watch.verged[-1],
            any(watch.verged),
            watch.falsely_verged,
            watch.aside_deg[-1],
            watch.seen_deg[-1],
            watch.stated_m,
            trace.reason[-1],
            _least_deg(simulator, head, point_m),
        )


def _least_deg(simulator: Simulator, head: Rig, point_m: Array) -> float:
    """Return half of how much higher a point (3,) [m] lies in one eye than in the other [deg]."""
    images = eye_images(head, (CameraModel(head.left_camera), CameraModel(head.right_camera)))
    left_y, right_y = (
        math.degrees(math.atan(image.undistort(pixel_of(simulator, eye, point_m))[0][1]))
        for eye, image in zip(EYES, images, strict=True)
    )
    return 0.5 * abs(left_y - right_y)


def pixel_of(simulator: Simulator, eye: str, point_m: Array) -> tuple[float, float]:
    """Return the pixel (x, y), as the lens distorts it, at which an eye sees a point (3,) [m]."""
    return simulator.lenses[eye].distorted(simulator.project(eye, point_m))


def _placed(simulator: Simulator, head: Rig, random: np.random.Generator) -> Array:
    """Place a thing, turn the head to where both eyes see it, and return the point (3,) [m] to click on."""
    distance_m = math.exp(random.uniform(math.log(NEAREST_M), math.log(FARTHEST_M)))
    azimuth, elevation = (float(random.uniform(-most, most)) for most in (_AZIMUTH_RAD, _ELEVATION_RAD))
    simulator.place_target(_THINGS[int(random.integers(len(_THINGS)))], place(distance_m, azimuth, elevation))
    point_m = np.asarray(simulator.truth().target_point_m, np.float64)
    kinematics = Kinematics(head)
    while True:
        settle(simulator, joints_of(head, in_view_start(point_m, random, kinematics)), random)
        if all(_shows(simulator.lenses[eye].camera, pixel_of(simulator, eye, point_m)) for eye in EYES):
            return point_m


def _shows(camera: CameraSpec, pixel: tuple[float, float]) -> bool:
    x, y = pixel
    inside_x = _IN_IMAGE_PX < x < camera.width_px - _IN_IMAGE_PX
    return inside_x and _IN_IMAGE_PX < y < camera.height_px - _IN_IMAGE_PX
