"""Rendered sequences for the comparison of trackers: a target at rest, moving, turning, covered, with the truth.

The eyes follow the true target two pairs late, as pursuit does, so that every tracker sees the same images. The joints
report angles a hundredth of a second old and off by a fifth of a degree, as hobby servos without feedback do.
"""

import math
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_rig.geometry import EyeAngles
from vergence_rig.rig import Rig
from vergence_rig.testing.ideal_eyes import gaze_for_point
from vergence_sim.parameters import SimParameters
from vergence_sim.scene import BOX_SIDES_M, CUBE_SIDE_M, MARKER_LENGTH_M, MARKER_RADIUS_M
from vergence_sim.simulator import Simulator

Image = NDArray[np.uint8]
Array = NDArray[np.float64]
Pixel = tuple[float, float]

FRAME_S = 1 / 30
REQUEST_FRAME = 3
THINGS = ("cube", "marker", "box")
TWINS = {"cube": "cube2", "marker": "stick", "box": "distractor"}
SIDES_M = {
    "cube": (CUBE_SIDE_M,) * 3,
    "marker": (2 * MARKER_RADIUS_M, 2 * MARKER_RADIUS_M, MARKER_LENGTH_M),
    "box": BOX_SIDES_M,
}
DISTANCE_M = 0.6
LAG_FRAMES = 2
"""Pairs by which pursuit is late."""
_REPORT_DELAY_S = 0.01
_BIAS_RAD = (math.radians(0.2), math.radians(-0.15))
_VISIBLE, _HIDDEN = 0.4, 0.1
_FAR_M = (0.0, 0.0, -5.0)


@dataclass(frozen=True)
class Frame:
    """One pair, (h, w) grey, with the truth at its exposure.

    `left_px`, `right_px` are of the surface point that is to be tracked, `outline_px` (N, 2) the convex outline of the
    target in the left image, `point_m` the surface point in rig_base (3,) [m]. `eyes` are the angles that the joints
    report, `true_eyes` the true ones. `colours` are both images (h, w, 3) BGR. `visible` and `hidden`: much of the
    target is in view of the left eye, or next to nothing.
    """

    stamp_s: float
    left: Image
    right: Image
    colours: tuple[Image, Image]
    eyes: EyeAngles
    left_px: Pixel
    right_px: Pixel
    point_m: Array
    outline_px: Array
    visible: bool
    hidden: bool
    true_eyes: EyeAngles


@dataclass(frozen=True)
class Pose:
    """What is where at a time: the target's centre (3,) [m] and yaw [rad], occluder and twin, or None for absent."""

    center_m: tuple[float, float, float]
    yaw_rad: float = 0.0
    occluder_m: tuple[float, float, float] | None = None
    twin_m: tuple[float, float, float] | None = None


@dataclass(frozen=True)
class Scene:
    """A sequence: its name, its length in pairs, the pose at each time, and how the rig and the eyes turn."""

    name: str
    pairs: int
    pose: Callable[[float], Pose]
    rig_yaw_rad: Callable[[float], float] = lambda _: 0.0
    eyes: str = "follow"


def at_angle(degrees: float) -> tuple[float, float, float]:
    """Return the place (3,) [m] at the usual distance, to the left by an angle."""
    angle = math.radians(degrees)
    return DISTANCE_M * math.cos(angle), DISTANCE_M * math.sin(angle), 0.0


def _still(_: float) -> Pose:
    return Pose(at_angle(0.0))


def _moving(speed_deg_s: float, from_deg: float) -> Callable[[float], Pose]:
    return lambda t: Pose(at_angle(from_deg + speed_deg_s * max(t - 0.3, 0.0)))


def _turning(t: float) -> Pose:
    """Turn at 30 degrees a second to +30 degrees, then to -30."""
    degrees = min(max(30.0 * (t - 0.3), 0.0), 60.0 - max(30.0 * (t - 0.3), 30.0))
    return Pose(at_angle(0.0), math.radians(max(degrees, -30.0)))


def _half_hidden(t: float) -> Pose:
    """A board slides in until it covers the left half, and stays."""
    # Seen by the left eye its edge stands just beside the target point.
    x = DISTANCE_M - 0.12
    edge = 0.0325 * (1.0 - x / DISTANCE_M) + 0.004
    slid = 0.25 * max(1.0 - max(t - 0.5, 0.0) / 0.8, 0.0)
    return Pose(at_angle(0.0), occluder_m=(x, edge + 0.09 + slid, 0.0))


def _crossing(t: float) -> Pose:
    """A twin passes before the target and covers it for a while."""
    return Pose(at_angle(0.0), twin_m=(DISTANCE_M - 0.15, 0.2 - 0.22 * max(t - 0.3, 0.0), 0.0))


def _nodding(t: float) -> float:
    return math.radians(8.0) * math.sin(2 * math.pi * 0.3 * t)


SCENES = (
    Scene("rest", 60, _still),
    Scene("5_deg_s", 60, _moving(5.0, -4.0)),
    Scene("20_deg_s", 60, _moving(20.0, -17.0)),
    Scene("turning", 105, _turning),
    Scene("half_hidden", 75, _half_hidden),
    Scene("twin", 75, _crossing),
    Scene("rig_yaw", 110, _still, _nodding),
)


def sequence(scene: Scene, thing: str, seed: int = 0) -> Iterator[Frame]:
    """Yield the pairs of a scene with one of THINGS as the target."""
    parameters = SimParameters.of(
        {"servo": "ideal", "head.model": "ideal", "world.seed": seed, "seed": seed, "world.extra_cubes": 1}
    )
    with closing(Simulator(parameters)) as simulator:
        simulator.place_object("cube2", _FAR_M)
        yield from _Sequence(scene, thing, simulator).frames()


def rig() -> Rig:
    """Return the rig that every sequence is seen with."""
    with closing(Simulator(SimParameters.of({"head.model": "ideal"}), render=False)) as simulator:
        return simulator.rig


class _Sequence:
    def __init__(self, scene: Scene, thing: str, simulator: Simulator) -> None:
        self._scene, self._thing, self._simulator = scene, thing, simulator
        first = scene.pose(0.0)
        simulator.place_target(thing, first.center_m)
        self._on_target = simulator.truth().target_point_m - np.array(first.center_m)

    def frames(self) -> Iterator[Frame]:
        scene, simulator = self._scene, self._simulator
        gazes: list[EyeAngles] = []
        for k in range(scene.pairs):
            t = k * FRAME_S
            rate = (scene.rig_yaw_rad(t) - scene.rig_yaw_rad(t - FRAME_S)) / FRAME_S if k else 0.0
            pose = scene.pose(t)
            simulator.set_parameters(
                simulator.parameters.replaced({"rig_yaw_rate_rad_s": rate, "target.yaw_rad": pose.yaw_rad})
            )
            simulator.advance_to(t)
            simulator.place_target(self._thing, pose.center_m)
            for name, place in (("occluder", pose.occluder_m), (TWINS[self._thing], pose.twin_m)):
                simulator.place_object(name, place or _FAR_M)
            point = self._surface_point(pose)
            gazes.append(self._gaze(point, scene.rig_yaw_rad(t)))
            eyes = gazes[max(k - LAG_FRAMES, 0)] if scene.eyes == "follow" else gazes[0]
            before = gazes[max(k - LAG_FRAMES - 1, 0)] if scene.eyes == "follow" else gazes[0]
            yield self._frame(t, pose, point, eyes, reported_angles(eyes, before))

    def _surface_point(self, pose: Pose) -> Array:
        return np.array(pose.center_m) + _yawed(pose.yaw_rad) @ self._on_target

    def _gaze(self, point: Array, yaw_rad: float) -> EyeAngles:
        return gaze_for_point(_yawed(-yaw_rad) @ point, self._simulator.rig.baseline_m)

    def _frame(self, t: float, pose: Pose, point: Array, eyes: EyeAngles, reported: EyeAngles) -> Frame:
        simulator = self._simulator
        simulator.set_head(eyes.as_dict())
        shown = simulator.capture(skew_s=0.0)
        share = shown.truth.left_visible_share
        sides = np.array(SIDES_M[self._thing])
        corners = np.array(np.meshgrid([-0.5, 0.5], [-0.5, 0.5], [-0.5, 0.5])).T.reshape(-1, 3) * sides
        outline = [
            simulator.project("left", np.array(pose.center_m) + _yawed(pose.yaw_rad) @ corner) for corner in corners
        ]
        left, right = (cv2.cvtColor(image, cv2.COLOR_BGR2GRAY) for image in (shown.left, shown.right))
        return Frame(
            t,
            left,
            right,
            (shown.left, shown.right),
            reported,
            simulator.project("left", point),
            simulator.project("right", point),
            point,
            cv2.convexHull(np.array(outline, np.float32)).reshape(-1, 2).astype(np.float64),
            share >= _VISIBLE,
            share < _HIDDEN,
            eyes,
        )


def _yawed(yaw_rad: float) -> Array:
    c, s = math.cos(yaw_rad), math.sin(yaw_rad)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def reported_angles(eyes: EyeAngles, before: EyeAngles) -> EyeAngles:
    """Return what the joints report: angles from a little earlier, off by a constant.

    `before` are those of the pair before.
    """
    late = _REPORT_DELAY_S / FRAME_S
    return EyeAngles(
        eyes.pan_left_rad + late * (before.pan_left_rad - eyes.pan_left_rad) + _BIAS_RAD[0],
        eyes.pan_right_rad + late * (before.pan_right_rad - eyes.pan_right_rad) + _BIAS_RAD[1],
        eyes.tilt_rad + late * (before.tilt_rad - eyes.tilt_rad),
    )
