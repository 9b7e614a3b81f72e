"""A head without hardware, pixels or physics: servo plants, a point as target, and sightings with noise and latency.

Tests and benchmarks run the controller against it, faster than real time. What it sees comes from its own true
shafts, by the definition of the axes; only the servo plant is shared with the rest.
"""

import heapq
import itertools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from vergence_gaze.control.report import Command
from vergence_gaze.estimation.observations import (
    BoxSighting,
    DetectedObject,
    EdgeContrast,
    JointReport,
    Observation,
    TrackSighting,
)
from vergence_gaze.goals.goal import ObjectRequest
from vergence_rig.kinematics import Kinematics
from vergence_rig.rig import JOINT_NAMES, Rig
from vergence_rig.servo import ServoPlant, ServoSpec

Array = npt.NDArray[np.float64]

TICK_S = 1.0 / 300.0
"""Everything happens on this raster: 30 Hz images every 10 ticks, 50 Hz joint reports every 6."""


TARGET_ID = 1
"""The target's id among the detected objects."""


@dataclass(frozen=True)
class VisionModel:
    """Images and estimators. Latency is from exposure to the result's arrival; noise and offsets are of the image."""

    latency_s: float = 0.06
    frame_ticks: int = 10
    skew_ticks: int = 2
    noise_px: float = 0.3
    right_roll_rad: float = 0.0
    right_vertical_px: float = 0.0
    stamp_error_s: float = 0.0
    track: bool = True
    boxes: bool = False
    box_frame_ticks: int = 20
    box_latency_s: float = 0.11
    box_noise_px: float = 1.5
    surface_noise_px: float = math.nan
    box_miss_share: float = 0.05
    field_margin_px: float = 15.0
    extent_rad: float = 0.1


@dataclass
class FakeHead:
    """Rig, true servos, target and eyes. `visible(t)` hides the target; `target(t)` gives it (3,) in rig_base [m].

    `built` is the head as it is built, where it differs from the description that the controller has.

    `mistaken` gives, by estimator ("fovea" for the contrast, "track", "box"), the point that it measures instead of the
    target at `t`, or None while it is right. `servos` are the real servos by joint, where they differ from the rig's
    description. Time starts at `begin_s`.

    `others` are further objects that the detector sees, by id (not TARGET_ID), each with its class and its path. The
    detector measures the requested one; without a request the target, and where that is not in view any other. The
    tracker follows the object that was measured last when it was asked.
    """

    rig: Rig
    target: Callable[[float], Array]
    vision: VisionModel = field(default_factory=VisionModel)
    seed: int = 0
    start_rad: Mapping[str, float] = field(default_factory=dict)
    visible: Callable[[float], bool] = lambda time_s: True
    mistaken: Mapping[str, Callable[[float], Array | None]] = field(default_factory=dict)
    servos: Mapping[str, ServoSpec] = field(default_factory=dict)
    begin_s: float = 0.0
    report_ticks: int = 6
    built: Rig | None = None
    class_name: str = "target"
    others: Mapping[int, tuple[str, Callable[[float], Array]]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._built = self.built or self.rig
        self._kinematics = Kinematics(self._built)
        self._random = np.random.default_rng(self.seed)
        self._ticks = 0
        self._order = itertools.count()
        self._arrivals: list[tuple[float, int, Observation]] = []
        self._plants: dict[str, ServoPlant] = {}
        self._models: dict[str, ServoPlant] = {}
        for name, joint in self.rig.joints.items():
            servo, start = self.servos.get(name, joint.servo), self.start_rad.get(name, 0.0)
            # At rest a shaft lies anywhere in its play.
            half = servo.half_play_rad
            self._plants[name] = ServoPlant(servo, start + self._random.uniform(-half, half), self.begin_s)
            self._models[name] = ServoPlant(joint.servo, start, self.begin_s)
        self.reported_rad = {name: self.start_rad.get(name, 0.0) for name in JOINT_NAMES}
        self._goal_id, self._track_id, self._lock_s = 0, 0, self.begin_s
        self.wanted = ObjectRequest()
        """What the detector was asked for."""
        self.chosen_id = self._tracked_id = TARGET_ID
        """The object that the detector has measured last."""
        self._pending_frame: tuple[float, Array, bool] | None = None
        self._left_pixel = np.full(2, math.nan)

    @property
    def time_s(self) -> float:
        """The present."""
        return self.begin_s + self._ticks * TICK_S

    @property
    def true_rad(self) -> Array:
        """The true eye angles (3,), pan_left, pan_right, tilt."""
        return np.array(self._built.eye_angles([self._plants[name].true_rad for name in JOINT_NAMES]))

    def command(self, joints_rad: Array) -> None:
        """Command the joints (3,)."""
        for name, angle in zip(JOINT_NAMES, joints_rad, strict=True):
            self._plants[name].command(float(angle), self.time_s)
            self._models[name].command(float(angle), self.time_s)

    def execute(self, command: Command) -> None:
        """Do what a controller's cycle asks for: turn the joints, and track for a goal."""
        if command.object_request is not None:
            self.wanted = command.object_request
        if command.track_request is not None:
            self.track_for(command.track_request.goal_id)
        if command.joints_rad is not None:
            self.command(command.joints_rad)

    def track_for(self, goal_id: int) -> None:
        """Track the target on behalf of a goal from now on; 0 ends that."""
        self._goal_id, self._lock_s = goal_id, self.time_s
        self._track_id += 1
        self._tracked_id = self.chosen_id

    def true_errors_rad(self, object_id: int = TARGET_ID) -> Array:
        """Return (version, vergence, tilt) to the target, or to another object, minus the true ones (3,)."""
        wanted, true = self._kinematics.gaze_for_point(self._path(object_id)(self.time_s)), self.true_rad
        return np.array(
            [
                wanted.version_rad - 0.5 * (true[0] + true[1]),
                wanted.vergence_rad - (true[1] - true[0]),
                wanted.tilt_rad - true[2],
            ]
        )

    def advance(self) -> list[Observation]:
        """Move on by one tick and return the observations that arrived in it."""
        self._ticks += 1
        now_s = self.time_s
        for plant in (*self._plants.values(), *self._models.values()):
            plant.step(now_s)
        if self._ticks % self.report_ticks == 0:
            for name in JOINT_NAMES:
                self.reported_rad[name] = self._models[name].modelled_rad
            self._send(now_s + 0.002, JointReport(now_s, dict(self.reported_rad)))
        phase = self._ticks % self.vision.frame_ticks
        if phase == 0:
            self._pending_frame = (now_s, self._project(left=True), self.visible(now_s))
        if phase == self.vision.skew_ticks and self._pending_frame is not None:
            self._see_pair(*self._pending_frame, now_s)
            self._pending_frame = None
        arrived = []
        while self._arrivals and self._arrivals[0][0] <= now_s:
            arrived.append(heapq.heappop(self._arrivals)[2])
        return arrived

    def project(self, point_m: Array, left: bool) -> Array:
        """Return normalised image coordinates (2,), x right, y down, of a point; NaN behind the eye."""
        pan, tilt = self.true_rad[0 if left else 1], self.true_rad[2]
        ray = np.asarray(point_m) - self._kinematics.lens(left, pan, tilt)
        x, y, z = (ray @ self._kinematics.rotation_rig_from_optical(pan, tilt)).tolist()
        return np.array([x / z, y / z]) if z > 1e-6 else np.full(2, math.nan)

    def _path(self, object_id: int) -> Callable[[float], Array]:
        return self.target if object_id == TARGET_ID else self.others[object_id][1]

    def _project(self, left: bool) -> Array:
        return self.project(self._path(self._tracked_id)(self.time_s), left)

    def _see_pair(self, left_s: float, left_xy: Array, visible: bool, right_s: float) -> None:
        vision, focal = self.vision, self.rig.left_camera.fx_px
        right_xy = self._misaligned(self._project(left=False))
        noise = self._random.normal(0.0, vision.noise_px / focal, 4)
        in_left = visible and self._in_view(left_xy)
        in_right = visible and self._in_view(right_xy)
        left_xy, right_xy = left_xy + noise[:2], right_xy + noise[2:]
        arrival_s = right_s + vision.latency_s
        left_s, right_s = left_s + vision.stamp_error_s, right_s + vision.stamp_error_s
        disparity = math.atan(left_xy[0]) - math.atan(right_xy[0]) if in_left and in_right else math.nan
        sigma = 1.5 * vision.noise_px / focal
        skew_s = right_s - left_s
        if vision.track:
            usable = in_left and self._goal_id > 0
            self._send(
                arrival_s,
                TrackSighting(
                    left_s,
                    skew_s,
                    self._track_id,
                    self._lock_s,
                    float(left_xy[0]),
                    float(left_xy[1]),
                    disparity + self._mistake_rad("track", left_s, disparity),
                    sigma,
                    vision.extent_rad,
                    usable,
                    goal_id=self._goal_id,
                ),
            )
        on_fovea = in_left and math.hypot(*left_xy) < 0.05
        at_fovea = disparity + self._mistake_rad("fovea", left_s, disparity)
        pixels = abs(at_fovea) * focal if on_fovea and in_right else math.inf
        contrast = 0.3 + 0.68 * (1.0 - math.exp(-((pixels / 3.6) ** 1.2))) + self._random.normal(0.0, 0.03)
        self._send(arrival_s, EdgeContrast(left_s, contrast, min(pixels, 8.0) + 1.0))
        if vision.boxes and self._ticks % vision.box_frame_ticks < vision.frame_ticks:
            if self.others:
                self._choose(left_s)
            if self._tracked_id != self.chosen_id:
                left_xy, right_xy = (self.project(self._path(self.chosen_id)(left_s), left) for left in (True, False))
                in_left, in_right = self._in_view(left_xy), self._in_view(right_xy)
            self._see_boxes(left_s, skew_s, left_xy if in_left else None, right_xy if in_right else None)

    def _in_sight(self, time_s: float) -> dict[int, str]:
        """Return the classes of the objects in view of the left eye, by id."""
        named = {TARGET_ID: self.class_name} | {number: name for number, (name, _) in self.others.items()}
        return {
            number: name
            for number, name in named.items()
            if (number != TARGET_ID or self.visible(time_s))
            and self._in_view(self.project(self._path(number)(time_s), left=True))
        }

    def _choose(self, time_s: float) -> None:
        """Choose which object is measured, as box_metric_node does."""
        seen, wanted = self._in_sight(time_s), self.wanted
        fitting = [number for number, name in seen.items() if wanted.class_name in ("", name)]
        if wanted.object_id in seen:
            self.chosen_id = wanted.object_id
        elif fitting and self.chosen_id not in fitting:
            self.chosen_id = fitting[0]

    def _mistake_rad(self, estimator: str, time_s: float, disparity_rad: float) -> float:
        """Return how far an estimator's disparity is off because it measures another object; 0 if it does not."""
        other = self.mistaken[estimator](time_s) if estimator in self.mistaken else None
        if other is None or not math.isfinite(disparity_rad):
            return 0.0
        left, right = self.project(other, left=True), self.project(other, left=False)
        return math.atan(left[0]) - math.atan(right[0]) - disparity_rad

    def _see_boxes(self, left_s: float, skew_s: float, left_xy: Array | None, right_xy: Array | None) -> None:
        vision, focal = self.vision, self.rig.left_camera.fx_px
        elsewhere = self.mistaken["box"](left_s) if "box" in self.mistaken else None
        if elsewhere is not None:
            left_xy, right_xy = self.project(elsewhere, left=True), self.project(elsewhere, left=False)
        if self._random.random() < vision.box_miss_share:
            left_xy = right_xy = None
        surface_sigma_rad, surface_rad = vision.surface_noise_px / focal, math.nan
        if left_xy is not None and right_xy is not None:
            surface_rad = math.atan(left_xy[0]) - math.atan(right_xy[0])
        angles = np.full(4, math.nan)
        for i, xy in enumerate((left_xy, right_xy)):
            if xy is not None:
                blurred = xy + self._random.normal(0.0, vision.box_noise_px / focal, 2)
                angles[2 * i : 2 * i + 2] = np.arctan(blurred)
        usable = left_xy is not None or right_xy is not None
        seen = self._in_sight(left_s)
        name = self.class_name if self.chosen_id == TARGET_ID else self.others[self.chosen_id][0]
        self._send(
            left_s + skew_s - vision.stamp_error_s + vision.box_latency_s,
            BoxSighting(
                stamp_s=left_s,
                skew_s=skew_s,
                left_azimuth_rad=float(angles[0]),
                left_elevation_rad=float(angles[1]),
                right_azimuth_rad=float(angles[2]),
                right_elevation_rad=float(angles[3]),
                surface_disparity_rad=surface_rad + self._random.normal(0.0, 1.0) * surface_sigma_rad,
                surface_sigma_rad=surface_sigma_rad,
                sigma_rad=vision.box_noise_px / focal,
                extent_rad=vision.extent_rad,
                class_name=name if usable else "",
                usable=usable,
                extent_height_rad=vision.extent_rad,
                object_id=self.chosen_id if usable else 0,
                objects=tuple(DetectedObject(number, seen_name) for number, seen_name in seen.items()),
            ),
        )

    def _misaligned(self, xy: Array) -> Array:
        sine, cosine = math.sin(self.vision.right_roll_rad), math.cos(self.vision.right_roll_rad)
        offset = self.vision.right_vertical_px / self.rig.right_camera.fy_px
        return np.array([cosine * xy[0] - sine * xy[1], sine * xy[0] + cosine * xy[1] - offset])

    def _in_view(self, xy: Array) -> bool:
        camera = self.rig.left_camera
        margin = self.vision.field_margin_px
        return bool(
            abs(xy[0]) * camera.fx_px < 0.5 * camera.width_px - margin
            and abs(xy[1]) * camera.fy_px < 0.5 * camera.height_px - margin
        )

    def _send(self, arrival_s: float, observation: Observation) -> None:
        heapq.heappush(self._arrivals, (arrival_s, next(self._order), observation))
