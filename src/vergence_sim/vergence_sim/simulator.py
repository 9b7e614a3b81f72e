"""The simulator in lockstep, without ROS: command joints, advance time, render images, read the ground truth."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
import numpy.typing as npt

from vergence_rig.rig import Rig, default_rig
from vergence_sim.head import Head, with_chosen_servos
from vergence_sim.heads import published_cameras, simulated_head
from vergence_sim.memory import return_free_memory
from vergence_sim.motion import offset_m
from vergence_sim.optics import Lens, Sensor, motion_blurred
from vergence_sim.parameters import TARGETS, SimParameters
from vergence_sim.persons import PERSONS, person_place_m
from vergence_sim.renderer import EyeRenderer
from vergence_sim.scene import OBJECTS, STAND, build_scene, release_textures
from vergence_sim.truth import GroundTruth, TrueBox, Truth

Array = npt.NDArray[np.float64]
Image = npt.NDArray[np.uint8]


class TargetError(ValueError):
    """An object that is not in the world, or an invalid place for it."""


@dataclass(frozen=True)
class StereoFrame:
    """One pair: (h, w, 3) BGR images, their exposure times, and the truth at the left one."""

    left: Image
    right: Image
    left_stamp_s: float
    right_stamp_s: float
    truth: Truth


class Simulator:
    """A head in a room. Deterministic: the same parameters and calls give the same images.

    Time is `time_s`, from 0, and advances only by `advance` and `advance_to`. `render=False` needs no OpenGL and cannot
    render images.
    """

    def __init__(
        self,
        parameters: SimParameters | None = None,
        rig: Rig | None = None,
        render: bool = True,
        head: Rig | None = None,
        alone: bool = False,
    ) -> None:
        """Make the head and its room.

        Args:
            parameters: of the simulation.
            rig: that a driver and the other nodes are given; the built-in one if none.
            render: False for no images.
            head: the head that is simulated, as a rig of its own; the parameters' if none.
            alone: True if this process makes no other simulator: memory that others would share is freed.
        """
        self.parameters = (parameters or SimParameters()).effective()
        simulation, self.rig = self.parameters.simulation, rig or default_rig()
        built = simulated_head(self.parameters.head, self.rig) if head is None else head
        self.head = Head(with_chosen_servos(self.rig, simulation), with_chosen_servos(built, simulation))
        self.time_s = 0.0
        cameras = {"left": built.left_camera, "right": built.right_camera}
        self.lenses = {eye: Lens(camera) for eye, camera in cameras.items()}
        self.calibrations = published_cameras(self.parameters.head.camera_info, self.rig, built)
        fields = [2 * math.atan(0.5 * lens.camera.height_px / lens.render_focal_px) for lens in self.lenses.values()]
        self._model = build_scene(built, self.parameters, (fields[0], fields[1]), textured=render)
        self._data = mujoco.MjData(self._model)
        self._truth = GroundTruth(self._model, self._data, self.lenses, built)
        sizes_px = {eye: (camera.width_px, camera.height_px) for eye, camera in cameras.items()}
        self._renderer = EyeRenderer(self._model, sizes_px) if render else None
        if render and alone:
            release_textures(self._model)
        seeds = np.random.SeedSequence(simulation.seed).spawn(2)
        self._sensors = (
            {
                eye: Sensor(np.random.default_rng(seed), (height, width), eye == "right")
                for (eye, (width, height)), seed in zip(sizes_px.items(), seeds, strict=True)
            }
            if render
            else {}
        )
        self._projected: dict[str, tuple[Image, Image]] = {}
        self._yaw_rad = 0.0
        start = self.parameters.target
        self._places: dict[str, Array] = {
            name: np.array([0.0, 0.3 * number, -5.0]) for number, name in enumerate(TARGETS)
        }
        self._places[start.object] = np.array([start.x_m, start.y_m, start.z_m])
        self._motion_since_s = self._persons_since_s = 0.0
        self._update()

    def set_parameters(self, parameters: SimParameters) -> None:
        """Apply changed parameters (those that are not fixed at the start); a changed motion begins now."""
        parameters = parameters.effective()
        target_changes = parameters.target.object != self.parameters.target.object
        if target_changes or parameters.motion != self.parameters.motion:
            self._motion_since_s = self.time_s
        if parameters.persons != self.parameters.persons:
            self._persons_since_s = self.time_s
        if target_changes:
            self._hide(self.parameters.target.object)
        self.parameters = parameters
        self._update()

    def command(self, angles_rad: Mapping[str, float], now_s: float | None = None) -> None:
        """Command joints by name [rad], at `now_s` or now."""
        self.head.command(angles_rad, self.time_s if now_s is None else now_s)

    def set_head(self, angles_rad: Mapping[str, float]) -> None:
        """Set the joints' angles [rad] at once, without the servos: for studies of images against angles."""
        self.head.place(angles_rad, self.time_s)
        self._update()

    def advance(self, duration_s: float) -> None:
        """Advance time."""
        self.advance_to(self.time_s + duration_s)

    def advance_to(self, time_s: float) -> None:
        """Advance time to `time_s`; an earlier time changes nothing."""
        if time_s <= self.time_s:
            return
        self._yaw_rad += self.parameters.simulation.rig_yaw_rate_rad_s * (time_s - self.time_s)
        self.time_s = time_s
        self.head.step(time_s)
        self._update()

    def place_target(self, name: str, point_m: Sequence[float] | Array) -> None:
        """Place an object's centre in rig_base (3,) [m] and make it the target; its motion begins anew."""
        place = np.asarray(point_m, np.float64)
        if name not in TARGETS:
            raise TargetError(f"target must be one of {', '.join(TARGETS)}: got {name!r}")
        if place.shape != (3,) or not np.isfinite(place).all():
            raise TargetError(f"place of {name} must be three finite numbers [m]: got {point_m!r}")
        if name != self.parameters.target.object:
            self._hide(self.parameters.target.object)
            self.parameters = self.parameters.replaced({"target.object": name})
        self._places[name] = place
        self._motion_since_s = self.time_s
        self._update()

    def place_object(self, name: str, point_m: Sequence[float] | Array) -> None:
        """Place any movable object's centre in rig_base (3,) [m]; which one is the target stays as it is.

        Both targets, `occluder` (an upright board of 18 by 24 cm), `distractor` (a box 6 cm wide in the cube's
        colours), as many of `cube2`, `cube3`, `cube4` as `world.extra_cubes` says, and as many of `person1`, `person2`,
        `person3` as `persons.count` says, which no longer move from then on. Below the floor they are hidden.
        """
        place = np.asarray(point_m, np.float64)
        if name not in OBJECTS or mujoco.mj_name2id(self._model, mujoco.mjtObj.mjOBJ_BODY, name) < 0:
            raise TargetError(f"object must be one of {', '.join(OBJECTS)}, and in the room: got {name!r}")
        if place.shape != (3,) or not np.isfinite(place).all():
            raise TargetError(f"place of {name} must be three finite numbers [m]: got {point_m!r}")
        self._places[name] = place
        self._update()

    def view(self, eye: str) -> Image:
        """Return the image that one eye, "left" or "right", takes now: (h, w, 3) BGR uint8."""
        return self.expose(eye)()

    def expose(self, eye: str) -> Callable[[], Image]:
        """Expose one eye now; return a function that makes the image, for any thread, in the order of the exposures."""
        if self._renderer is None:
            raise ValueError("a simulator made with render=False has no images: make it with render=True")
        view, motion_px, parameters = self._renderer.render(self._data, eye), self._motion_px(eye), self.parameters

        def image() -> Image:
            blurred = motion_blurred(view, motion_px) if parameters.camera.exposure_s > 0 else view
            projected = self._through_lens(eye, blurred)
            taken = self._sensors[eye].apply(projected, parameters)
            return taken.copy() if taken is projected else taken

        return image

    def _through_lens(self, eye: str, view: Image) -> Image:
        """Return a view through the lens; the same array again for the view before, as long as nothing moves."""
        before = self._projected.get(eye)
        if before is None or before[0] is not view:
            before = self._projected[eye] = view, self.lenses[eye].apply(view)
        return before[1]

    def capture(self, skew_s: float | None = None) -> StereoFrame:
        """Return the next pair, the first of the two exposed now, with the truth at the left exposure.

        The right eye is exposed `skew_s` after the left one, before it if negative; None takes the skew of the two
        free-running clocks. Time advances by that much.
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
        """Time from a left exposure to the nearest right one [s], within half a period."""
        right = self.parameters.right_camera
        skew_s = right.clock_offset_s + right.clock_drift * self.time_s
        return math.remainder(skew_s, 1.0 / self.parameters.camera.frame_rate_hz)

    def truth(self) -> Truth:
        """Return the ground truth about the target now."""
        return self._truth.evaluate(self.parameters.target.object)

    def mean_disparity_px(self, grid: int) -> float:
        """Return the mean disparity [px] of the target's surface that both eyes see, from grid x grid rays per eye."""
        return self._truth.mean_disparity(self.parameters.target.object, grid)

    def project(self, eye: str, point_m: Sequence[float] | Array) -> tuple[float, float]:
        """Return the undistorted pixel (x, y) of a point in rig_base (3,) [m] in an eye's image; NaN behind the eye."""
        return self._truth.project(eye, self._in_world(np.asarray(point_m, np.float64)))

    def errors_to(self, point_m: Sequence[float] | Array) -> tuple[float, float, float]:
        """Return the errors (vergence, version, tilt) to a point in rig_base (3,) [m], in radians."""
        return self._truth.axis_errors(self._in_world(np.asarray(point_m, np.float64)))

    def angles_to_foveas(self, point_m: Sequence[float] | Array) -> tuple[float, float]:
        """Return the angles between a point in rig_base (3,) [m] and the left and the right optical axis [rad]."""
        point = self._in_world(np.asarray(point_m, np.float64))
        return self._truth.angle_to_fovea("left", point), self._truth.angle_to_fovea("right", point)

    def person_place_m(self, number: int) -> Array:
        """Return where person `number`, from 0, is now (3,) in rig_base [m]."""
        placed = self._places.get(PERSONS[number])
        since_s = self.time_s - self._persons_since_s
        return person_place_m(self.parameters.persons, number, since_s) if placed is None else placed

    def true_boxes(self, eye: str) -> list[TrueBox]:
        """Return the true boxes of targets, extra cubes and persons in one eye's image, lens distortion included."""
        boxes = (self._truth.box(eye, name) for name in self._truth.objects)
        return [box for box in boxes if box is not None]

    def true_box(self, eye: str, name: str) -> TrueBox | None:
        """Return one target's, extra cube's or person's true box in an eye's image; None where none is inside."""
        return self._truth.box(eye, name)

    def joint_states(self) -> dict[str, float]:
        """Return the joint angles [rad] as a driver of servos without position feedback reports them."""
        return self.head.modelled_rad

    def true_joints(self) -> dict[str, float]:
        """Return the true angles of the shafts, as joints [rad]."""
        return self.head.true_rad

    def close(self) -> None:
        """Free the renderer; idempotent."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None
            return_free_memory()

    def _motion_px(self, eye: str) -> tuple[float, float]:
        rates = self.head.axis_speeds_rad_s
        focal_px, exposure_s = self.lenses[eye].camera.fx_px, self.parameters.camera.exposure_s
        sideways = rates[f"pan_{eye}"] + self.parameters.simulation.rig_yaw_rate_rad_s
        return focal_px * sideways * exposure_s, focal_px * rates["tilt"] * exposure_s

    def _hide(self, name: str) -> None:
        self._places[name] = np.array([0.0, 0.3 * TARGETS.index(name), -5.0])  # below the floor

    def _update(self) -> None:
        data = self._data
        for name, angle in self.head.axes_rad.items():
            data.joint(name).qpos[0] = angle
        data.joint("yaw").qpos[0] = self._yaw_rad
        for name, place in self._places.items():
            moved = (
                place + offset_m(self.parameters.motion, self.time_s - self._motion_since_s)
                if name == self.parameters.target.object
                else place
            )
            data.mocap_pos[self._mocap(name)] = self._in_world(moved)
            if name in TARGETS:
                half = 0.5 * self.parameters.target.yaw_rad
                data.mocap_quat[self._mocap(name)] = (math.cos(half), 0.0, 0.0, math.sin(half))
        for number, name in enumerate(PERSONS[: self.parameters.persons.count]):
            if name not in self._places:
                data.mocap_pos[self._mocap(name)] = self._in_world(self.person_place_m(number))
        mujoco.mj_kinematics(self._model, data)
        mujoco.mj_camlight(self._model, data)

    def _mocap(self, body: str) -> int:
        return int(self._model.body_mocapid[self._model.body(body).id])

    def _in_world(self, point_m: Array) -> Array:
        # Places are in the rig's frame at the start: targets do not turn with the rig.
        return point_m + self._model.body(STAND).pos
