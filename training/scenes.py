"""Rooms of the simulator with several cubes, look-alikes and occluders, seen from anywhere: renders with true boxes."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from training.crowd import CUBES, LOOK_ALIKES, CrowdBuilder
from training.eye_renderer import EyeRenderer
from training.labels import Label, label
from training.webcam import webcam
from vergence_rig.rig import default_rig
from vergence_sim.scene import CUBE_SIDE_M, STAND

Image = NDArray[np.uint8]
Array = NDArray[np.float64]

WIDTH_PX, HEIGHT_PX = 640, 480
_FOCAL_PX = 539.0
_HIDDEN = np.array([0.0, 0.0, -5.0])
_LEAST_SHARE = 0.35
_GONE_SHARE = 0.06


@dataclass(frozen=True)
class View:
    """One render (480, 640, 3) BGR and the boxes of the cubes in it.

    `boxes_px` (M, 4) xyxy with the origin at the centre of the top-left pixel: the geometric outline where nothing
    hides any of it, else the box of what is seen. `visible` (M,) is the share of each outline that is seen, what lies
    beyond the border counted as unseen. `cut` (M,) is True for those that the border cuts. `alike_px` (K, 4) are
    boxes about the look-alikes in view, to a third of their size.
    """

    image: Image
    boxes_px: Array
    visible: Array
    cut: NDArray[np.bool_]
    alike_px: Array


@dataclass(frozen=True)
class StereoView:
    """A pair of renders, the cubes' boxes by number in each eye (those seen whole), and the pans and tilt [rad]."""

    images: tuple[Image, Image]
    boxes_px: tuple[dict[int, Array], dict[int, Array]]
    angles_rad: tuple[float, float, float]


class Stage:
    """One world, from its seed; `views` yields renders from random places, the same for the same seed."""

    def __init__(self, seed: int, samples: int | None = None, puzzle_share: float = 0.2) -> None:
        """Build it; `puzzle_share` of the look-alikes are puzzles of another number of cells."""
        self._rng = np.random.default_rng([seed, 7])
        rig = default_rig()
        self._focal_px = _FOCAL_PX
        builder = CrowdBuilder(rig, seed, int(self._rng.choice([0, 0, 4])) if samples is None else samples)
        builder.room()
        builder.furniture()
        builder.targets()
        builder.populate(puzzle_share)
        field_rad = 2 * math.atan(0.5 * HEIGHT_PX / _FOCAL_PX)
        builder.head((field_rad, field_rad))
        self._model = builder.compile(WIDTH_PX, HEIGHT_PX, 1.0)
        self._smallest_px, self._puzzles = builder.smallest_px, builder.puzzles
        self._data = mujoco.MjData(self._model)
        self._base = self._model.body(STAND).pos.copy()
        self._light = (
            self._model.vis.headlight.ambient.copy(),
            self._model.vis.headlight.diffuse.copy(),
            self._model.light_diffuse.copy(),
        )
        self._renderer = EyeRenderer(self._model, self._data, (WIDTH_PX, HEIGHT_PX))

    def close(self) -> None:
        """Free the renderer."""
        self._renderer.close()

    def views(self, count: int, target_share: float = 0.75, more_share: float = 0.15) -> Iterator[View]:
        """Yield `count` views; in about `target_share` a cube was placed, each further one in `more_share` of those."""
        given = 0
        while given < count:
            view = self._view(self._rng.random() < target_share, more_share)
            if view is not None:
                given += 1
                yield view

    def stereo_views(self, count: int, cubes: int) -> Iterator[StereoView]:
        """Yield `count` pairs with `cubes` cubes each, some beside each other, none hidden or cut in both eyes."""
        given = 0
        while given < count:
            view = self._stereo_view(cubes)
            if view is not None:
                given += 1
                yield view

    def _stereo_view(self, cubes: int) -> StereoView | None:
        rng, data = self._rng, self._data
        self._pose_head()
        converged_rad = float(rng.uniform(0.0, 0.2))
        pan_rad = float(data.joint("pan_left").qpos[0])
        data.joint("pan_right").qpos[0] = pan_rad + converged_rad
        mujoco.mj_kinematics(self._model, data)
        mujoco.mj_camlight(self._model, data)
        row = rng.uniform(120, 360)
        for number in range(CUBES):
            width_px = float(np.exp(rng.uniform(np.log(12.0), np.log(45.0))))
            depth = CUBE_SIDE_M * 0.5 * self._focal_px / width_px
            place = self._world_of(rng.uniform(80, 560), row + rng.uniform(-12, 12), depth)
            self._set(f"cube{number}", place if number < cubes else _HIDDEN, _any_rotation(rng))
        for number in range(LOOK_ALIKES):
            self._place_alike(number, rng.random() < 0.2)
        self._set("marker", _HIDDEN)
        self._set("board", _HIDDEN)
        self._set_light(float(rng.uniform(0.6, 1.2)))
        images, boxes = [], []
        for eye in ("left", "right"):
            self._renderer.look_with(eye)
            mujoco.mj_kinematics(self._model, data)
            mujoco.mj_camlight(self._model, data)
            geoms = self._renderer.segmentation()
            labels = {number: self._label(f"cube{number}", geoms) for number in range(cubes)}
            boxes.append({n: np.array(found.box_px) for n, found in labels.items() if found and found.share > 0.6})
            images.append(webcam(rng, self._renderer.render()))
        self._renderer.look_with("left")
        if len(boxes[0]) + len(boxes[1]) < 3:
            return None
        angles = (pan_rad, pan_rad + converged_rad, float(data.joint("tilt").qpos[0]))
        return StereoView((images[0], images[1]), (boxes[0], boxes[1]), angles)

    def _view(self, with_cubes: bool, more_share: float) -> View | None:
        rng, data = self._rng, self._data
        self._pose_head()
        for number in range(CUBES):
            # One cube mostly; more of them teach that each is found for itself.
            shown = with_cubes and (number == 0 or rng.random() < more_share)
            self._place(f"cube{number}", shown, _width_px(rng))
        alikes = []
        for number in range(LOOK_ALIKES):
            shown = rng.random() < 0.35
            place = self._place_alike(number, shown)
            if place is not None:
                alikes.append(place)
        self._place("marker", rng.random() < 0.15, rng.uniform(10, 60))
        if with_cubes and rng.random() < 0.12:
            self._hide_partly()
        else:
            self._set("board", _HIDDEN)
        self._set_light(float(np.exp(rng.uniform(np.log(0.35), np.log(1.5)))))
        mujoco.mj_kinematics(self._model, data)
        mujoco.mj_camlight(self._model, data)
        boxes, shares, cuts = [], [], []
        geoms = self._renderer.segmentation()
        for number in range(CUBES):
            found = self._label(f"cube{number}", geoms)
            if found is None:
                continue
            if found.share < _LEAST_SHARE:
                if found.share < _GONE_SHARE:
                    continue
                return None  # neither an example nor a counterexample
            boxes.append(found.box_px)
            shares.append(found.share)
            cuts.append(found.cut)
        image = webcam(rng, self._renderer.render())
        return View(
            image,
            np.array(boxes, np.float64).reshape(-1, 4),
            np.array(shares),
            np.array(cuts, bool),
            np.array(alikes, np.float64).reshape(-1, 4),
        )

    def _pose_head(self) -> None:
        rng, data = self._rng, self._data
        data.joint("yaw").qpos[0] = rng.uniform(-np.pi, np.pi) if rng.random() < 0.5 else rng.uniform(-0.5, 0.5)
        data.joint("pan_left").qpos[0] = rng.uniform(-0.6, 0.6)
        data.joint("tilt").qpos[0] = rng.normal(0.05, 0.25)
        self._model.body("rig_base").pos = self._base + rng.uniform([-0.6, -0.8, -0.5], [0.5, 0.8, 0.4])
        mujoco.mj_kinematics(self._model, data)
        mujoco.mj_camlight(self._model, data)

    def _place_alike(self, number: int, shown: bool) -> Array | None:
        """Put a look-alike somewhere and return about its box (4,) [px].

        A puzzle is put whole, since the cells of one that is cut cannot be counted.
        """
        width_px = _width_px(self._rng, self._smallest_px[number])
        place = self._place(f"alike{number}", shown, width_px, 2.0 * width_px if self._puzzles[number] else 0.0)
        return None if place is None else np.tile(place, 2) + 1.2 * width_px * np.array([-1.0, -1.0, 1.0, 1.0])

    def _place(self, name: str, shown: bool, width_px: float, margin_px: float = 0.0) -> tuple[float, float] | None:
        """Put an object where a cube would be `width_px` wide in half-size images, its middle off the border."""
        rng = self._rng
        if not shown:
            self._set(name, _HIDDEN)
            return None
        depth = CUBE_SIDE_M * 0.5 * self._focal_px / width_px
        u, v = rng.uniform(margin_px, WIDTH_PX - margin_px), rng.uniform(margin_px, HEIGHT_PX - margin_px)
        self._set(name, self._world_of(u, v, depth), _any_rotation(rng))
        return u, v

    def _hide_partly(self) -> None:
        """Put the board before the first cube, off to a side."""
        rng = self._rng
        camera = self._data.camera("left")
        eye = np.array(camera.xpos)
        cube = np.array(self._data.mocap_pos[self._mocap("cube0")])
        aside = np.array(camera.xmat).reshape(3, 3)[:, :2] @ rng.uniform(-1, 1, 2)
        place = eye + 0.8 * (cube - eye) + aside / np.linalg.norm(aside) * rng.uniform(0.05, 0.09)
        self._set("board", place, _any_rotation(rng))

    def _world_of(self, u_px: float, v_px: float, depth_m: float) -> Array:
        camera = self._data.camera("left")
        ray = np.array([(u_px - 319.5) / self._focal_px, -(v_px - 239.5) / self._focal_px, -1.0]) * depth_m
        return np.asarray(np.array(camera.xpos) + np.array(camera.xmat).reshape(3, 3) @ ray)

    def _mocap(self, name: str) -> int:
        return int(self._model.body_mocapid[self._model.body(name).id])

    def _set(self, name: str, place: Array, rotation: Array | None = None) -> None:
        self._data.mocap_pos[self._mocap(name)] = place
        if rotation is not None:
            self._data.mocap_quat[self._mocap(name)] = rotation

    def _set_light(self, light: float) -> None:
        ambient, diffuse, lamp = self._light
        warm = self._rng.uniform(0.85, 1.0, 3)
        self._model.vis.headlight.ambient[:] = ambient * light
        self._model.vis.headlight.diffuse[:] = diffuse * light * self._rng.uniform(0.3, 2.0)
        self._model.light_diffuse[:] = lamp * light * warm * self._rng.uniform(0.2, 1.4)
        self._model.light_pos[0] = self._rng.uniform([-1, -2, 1.8], [3, 2, 2.5])

    def _label(self, name: str, geoms: NDArray[np.int32]) -> Label | None:
        geom = self._model.geom(name).id
        camera = self._data.camera(self._renderer.eye)
        signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).T.reshape(-1, 3)
        corners = (
            self._data.geom_xpos[geom]
            + signs * self._model.geom_size[geom] @ np.array(self._data.geom_xmat[geom]).reshape(3, 3).T
        )
        local = (corners - np.array(camera.xpos)) @ np.array(camera.xmat).reshape(3, 3)
        return label(local, geoms == geom, self._focal_px)


def _width_px(rng: np.random.Generator, smallest_px: float = 6.5) -> float:
    return float(np.exp(rng.uniform(np.log(smallest_px), np.log(75.0))))


def _any_rotation(rng: np.random.Generator) -> Array:
    """Upright as the simulator puts things in four of ten, else any rotation: a unit quaternion (4,)."""
    quaternion = rng.normal(size=4)
    if rng.random() < 0.4:
        turn = rng.uniform(-np.pi, np.pi) if rng.random() < 0.5 else 0.0
        quaternion = np.array([np.cos(turn / 2), 0.0, 0.0, np.sin(turn / 2)])
    return np.asarray(quaternion / np.linalg.norm(quaternion))
