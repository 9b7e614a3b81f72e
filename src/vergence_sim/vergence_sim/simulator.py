"""The simulator in lockstep, without ROS: command joints, advance the world, take pictures, ask for the truth."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
import numpy.typing as npt

from vergence_rig.rig import Rig, default_rig
from vergence_sim.head import Head
from vergence_sim.motion import offset_m
from vergence_sim.optics import Lens, Sensor, smeared
from vergence_sim.parameters import TARGETS, SimParameters
from vergence_sim.renderer import EyeRenderer
from vergence_sim.scene import OBJECTS, build_scene
from vergence_sim.truth import TrueBox, Truth, TruthTeller

Array = npt.NDArray[np.float64]
Image = npt.NDArray[np.uint8]


class TargetError(ValueError):
    """A target that is not in the world, or a place it cannot be put."""


@dataclass(frozen=True)
class StereoFrame:
    """One pair: (h, w, 3) BGR images, their exposure times, and the truth at the left one."""

    left: Image
    right: Image
    left_stamp_s: float
    right_stamp_s: float
    truth: Truth


class Simulator:
    """A head in a room. Deterministic: the same parameters and calls give the same pictures.

    Time is `time_s`, from 0, and moves only by `advance` and `advance_to`. `render=False` needs no OpenGL and cannot
    take pictures.
    """

    def __init__(self, parameters: SimParameters | None = None, rig: Rig | None = None, render: bool = True) -> None:
        self.parameters = (parameters or SimParameters()).effective()
        self.rig = rig or default_rig()
        self.head = Head(self.rig, self.parameters)
        self.time_s = 0.0
        cameras = {"left": self.rig.left_camera, "right": self.rig.right_camera}
        self.lenses = {eye: Lens(camera, self.parameters.distortion) for eye, camera in cameras.items()}
        focal_px = min(lens.render_focal_px for lens in self.lenses.values())
        if len({lens.render_focal_px for lens in self.lenses.values()}) > 1:
            raise ValueError(
                "the simulator renders both eyes with one focal length: left_camera and right_camera differ"
            )
        height, width = self.rig.left_camera.height_px, self.rig.left_camera.width_px
        self._model = build_scene(self.rig, self.parameters, 2 * math.atan(0.5 * height / focal_px), textured=render)
        self._data = mujoco.MjData(self._model)
        self._truth = TruthTeller(self._model, self._data, self.lenses)
        self._renderer = EyeRenderer(self._model, width, height) if render else None
        seeds = np.random.SeedSequence(self.parameters.seed).spawn(2)
        self._sensors = (
            {
                eye: Sensor(np.random.default_rng(seed), (height, width), eye == "right")
                for eye, seed in zip(("left", "right"), seeds, strict=True)
            }
            if render
            else {}
        )
        self._yaw_rad = 0.0
        start = self.parameters
        self._places: dict[str, Array] = {
            name: np.array([0.0, 0.3 * number, -5.0]) for number, name in enumerate(TARGETS)
        }
        self._places[start.target] = np.array([start.start_x_m, start.start_y_m, start.start_z_m])
        self._motion_since_s = 0.0
        self._update()

    def set_parameters(self, parameters: SimParameters) -> None:
        """Take changed parameters (those that are not fixed at the start); a changed motion begins now."""
        parameters = parameters.effective()
        names = (
            "target",
            *(spec.name for spec in SimParameters.specs() if spec.name.startswith(("motion", "station"))),
        )
        if any(getattr(parameters, name) != getattr(self.parameters, name) for name in names):
            self._motion_since_s = self.time_s
        if parameters.target != self.parameters.target:
            self._hide(self.parameters.target)
        self.parameters = parameters
        self._update()

    def command(self, angles_rad: Mapping[str, float], now_s: float | None = None) -> None:
        """Command joints by name [rad], at `now_s` or now."""
        self.head.command(angles_rad, self.time_s if now_s is None else now_s)

    def set_head(self, angles_rad: Mapping[str, float]) -> None:
        """Put the joints somewhere at once, past the servos: for studies of images against angles."""
        self.head.place(angles_rad, self.time_s)
        self._update()

    def advance(self, duration_s: float) -> None:
        """Let time pass."""
        self.advance_to(self.time_s + duration_s)

    def advance_to(self, time_s: float) -> None:
        """Let time pass until `time_s`; an earlier time changes nothing."""
        if time_s <= self.time_s:
            return
        self._yaw_rad += self.parameters.rig_yaw_rate_rad_s * (time_s - self.time_s)
        self.time_s = time_s
        self.head.step(time_s)
        self._update()

    def place_target(self, name: str, point_m: Sequence[float] | Array) -> None:
        """Put a target's centre somewhere in rig_base (3,) [m] and make it the target; its motion begins anew."""
        place = np.asarray(point_m, np.float64)
        if name not in TARGETS:
            raise TargetError(f"target is {name!r}: allowed is one of {', '.join(TARGETS)}")
        if place.shape != (3,) or not np.isfinite(place).all():
            raise TargetError(f"place is {point_m!r}: allowed are three finite numbers [m]")
        if name != self.parameters.target:
            self._hide(self.parameters.target)
            self.parameters = self.parameters.replaced(target=name)
        self._places[name] = place
        self._motion_since_s = self.time_s
        self._update()

    def place_object(self, name: str, point_m: Sequence[float] | Array) -> None:
        """Put any movable thing somewhere in rig_base (3,) [m]; which one is the target stays as it is.

        There are both targets, `occluder`, `distractor`, and as many of `cube2`, `cube3`, `cube4` as `extra_cubes` asks
        for. What is below the floor is hidden.
        """
        place = np.asarray(point_m, np.float64)
        if name not in OBJECTS or mujoco.mj_name2id(self._model, mujoco.mjtObj.mjOBJ_BODY, name) < 0:
            raise TargetError(f"object is {name!r}: allowed is one of {', '.join(OBJECTS)}, if the room has it")
        if place.shape != (3,) or not np.isfinite(place).all():
            raise TargetError(f"place is {point_m!r}: allowed are three finite numbers [m]")
        self._places[name] = place
        self._update()

    def place_occluder(self, point_m: Sequence[float] | Array) -> None:
        """Put the occluder, an upright board 18 by 24 cm, somewhere in rig_base (3,) [m]."""
        self.place_object("occluder", point_m)

    def place_distractor(self, point_m: Sequence[float] | Array) -> None:
        """Put the distractor, a box 6 cm wide in the cube's colours, somewhere in rig_base (3,) [m]."""
        self.place_object("distractor", point_m)

    def view(self, eye: str) -> Image:
        """Return what one eye, "left" or "right", sees now: (h, w, 3) BGR uint8."""
        return self.expose(eye)()

    def expose(self, eye: str) -> Callable[[], Image]:
        """Expose one eye now; what is returned makes the picture of it, on any thread, one after the other."""
        if self._renderer is None:
            raise ValueError("this simulator was made with render=False: it takes no pictures")
        view, motion_px, parameters = self._renderer.render(self._data, eye), self._motion_px(eye), self.parameters

        def develop() -> Image:
            seen = smeared(view, motion_px) if parameters.exposure_s > 0 else view
            return self._sensors[eye].apply(self.lenses[eye].apply(seen), parameters)

        return develop

    def capture(self, skew_s: float | None = None) -> StereoFrame:
        """Return the next pair, the first of the two exposed now; its truth is that of the left exposure.

        The right eye is exposed `skew_s` after the left one, before it if negative; None lets the two free-running
        clocks say. That much time has passed afterwards.
        """
        skew_s = self.skew_s if skew_s is None else skew_s
        right, right_stamp_s = None, self.time_s
        if skew_s < 0:
            right = self.view("right")
            self.advance(-skew_s)
        truth, left_stamp_s, left = self.truth(), self.time_s, self.view("left")
        if right is None:
            self.advance(skew_s)
            right, right_stamp_s = self.view("right"), self.time_s
        return StereoFrame(left, right, left_stamp_s, right_stamp_s, truth)

    @property
    def skew_s(self) -> float:
        """How much later than the left eye the right one's nearest exposure is now [s], within half a period."""
        parameters = self.parameters
        skew_s = parameters.right_clock_offset_s + parameters.right_clock_drift * self.time_s
        return math.remainder(skew_s, 1.0 / parameters.frame_rate_hz)

    def truth(self) -> Truth:
        """Return the truth about the target now."""
        return self._truth.look(self.parameters.target, self.head.true_rad)

    def mean_disparity_px(self, grid: int) -> float:
        """Return the mean disparity of what both eyes see of the target, from grid x grid rays an eye; see `truth`."""
        return self._truth.mean_disparity(self.parameters.target, grid)

    def project(self, eye: str, point_m: Sequence[float] | Array) -> tuple[float, float]:
        """Return where an eye sees a point of rig_base (3,) [m], before its lens distorts it [px]; NaN behind it."""
        return self._truth.project(eye, self._in_world(np.asarray(point_m, np.float64)))

    def errors_to(self, point_m: Sequence[float] | Array) -> tuple[float, float, float]:
        """Return how much vergence, version and tilt are short of a point of rig_base (3,) [m], in radians."""
        return self._truth.axis_errors(self._in_world(np.asarray(point_m, np.float64)))

    def true_boxes(self, eye: str) -> list[TrueBox]:
        """Return the true boxes of the targets in one eye's image, as the lens distorts it; further cubes included."""
        boxes = (self._truth.box(eye, name) for name in self._truth.objects)
        return [box for box in boxes if box is not None]

    def joint_states(self) -> dict[str, float]:
        """Return the joint angles as a driver of servos without feedback publishes them [rad]."""
        return self.head.modelled_rad

    def true_joints(self) -> dict[str, float]:
        """Return where the shafts really are [rad]."""
        return self.head.true_rad

    def close(self) -> None:
        """Free the renderer; twice is once."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def _motion_px(self, eye: str) -> tuple[float, float]:
        rates = self.head.velocity_rad_s
        focal_px, exposure_s = self.lenses[eye].camera.fx_px, self.parameters.exposure_s
        sideways = rates[f"pan_{eye}"] + self.parameters.rig_yaw_rate_rad_s
        return focal_px * sideways * exposure_s, focal_px * rates["tilt"] * exposure_s

    def _hide(self, name: str) -> None:
        self._places[name] = np.array([0.0, 0.3 * TARGETS.index(name), -5.0])  # below the floor

    def _update(self) -> None:
        data, joints = self._data, self.head.true_rad
        for name in ("pan_left", "pan_right", "tilt"):
            data.joint(name).qpos[0] = joints[name]
        data.joint("yaw").qpos[0] = self._yaw_rad
        for name, place in self._places.items():
            moved = (
                place + offset_m(self.parameters, self.time_s - self._motion_since_s)
                if name == self.parameters.target
                else place
            )
            data.mocap_pos[self._mocap(name)] = self._in_world(moved)
            if name in TARGETS:
                half = 0.5 * self.parameters.target_yaw_rad
                data.mocap_quat[self._mocap(name)] = (math.cos(half), 0.0, 0.0, math.sin(half))
        mujoco.mj_kinematics(self._model, data)
        mujoco.mj_camlight(self._model, data)

    def _mocap(self, body: str) -> int:
        return int(self._model.body_mocapid[self._model.body(body).id])

    def _in_world(self, point_m: Array) -> Array:
        # Places are given in the rig's frame as it stood at the start: a turning rig leaves its targets behind.
        return point_m + self._model.body("rig_base").pos
