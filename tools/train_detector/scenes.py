"""Rooms of the simulator with several cubes, look-alikes and occluders, seen from anywhere: renders with true boxes."""

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import mujoco
import numpy as np
from numpy.typing import NDArray

from tools.train_detector.look_alikes import KINDS, faces
from vergence_rig.rig import default_rig
from vergence_sim.pictures import cube_faces, look_alike_faces
from vergence_sim.scene import CUBE_SIDE_M, SceneBuilder
from vergence_sim.textures import collage

Image = NDArray[np.uint8]
Array = NDArray[np.float64]

CUBES = 3
LOOK_ALIKES = 8
WIDTH_PX, HEIGHT_PX = 640, 480
_FOCAL_PX = 539.0
_HIDDEN = np.array([0.0, 0.0, -5.0])
_CLEAR_SHARE = 0.97
_LEAST_SHARE = 0.35
_GONE_SHARE = 0.06


@dataclass(frozen=True)
class View:
    """One render (480, 640, 3) BGR and the boxes of the cubes in it.

    `boxes_px` (M, 4) xyxy with the origin at the centre of the top-left pixel: the geometric outline where nothing
    hides any of it, else the box of what is seen. `visible` (M,) is the share of each outline, as far as it lies in the
    image, that is seen. `cut` (M,) tells which ones the border cuts.
    """

    image: Image
    boxes_px: Array
    visible: Array
    cut: NDArray[np.bool_]


@dataclass(frozen=True)
class StereoView:
    """A pair of renders, the cubes' boxes by number in each eye (those seen whole), and the pans and tilt [rad]."""

    images: tuple[Image, Image]
    boxes_px: tuple[dict[int, Array], dict[int, Array]]
    angles_rad: tuple[float, float, float]


class CrowdBuilder(SceneBuilder):
    """The simulator's room with more movable things in it."""

    def populate(self) -> None:
        """Several cubes, each scrambled its own way, look-alikes of all kinds, and an occluder."""
        rng = self._rng
        half = CUBE_SIDE_M / 2
        for number in range(CUBES):
            self.wrap(f"cube{number}", cube_faces(rng))
            self._put(f"cube{number}", f'type="box" size="{half} {half} {half}"', f"cube{number}")
        for number in range(LOOK_ALIKES):
            name = f"alike{number}"
            # Some are the simulator's own, puzzles of 2, 4 and 5 cells a side among them.
            own = rng.random() < 0.35
            self.wrap(name, look_alike_faces(rng) if own else faces(rng, str(rng.choice(list(KINDS)))))
            if rng.random() < 0.75:
                sides = half * rng.uniform(0.7, 1.6, 3) if rng.random() < 0.5 else np.full(3, half)
                shape = f'type="box" size="{sides[0]} {sides[1]} {sides[2]}"'
            elif rng.random() < 0.5:
                shape = f'type="sphere" size="{half * rng.uniform(0.7, 1.4)}"'
            else:
                shape = f'type="cylinder" size="{half * rng.uniform(0.6, 1.2)} {half * rng.uniform(0.7, 2)}"'
            self._put(name, shape, name)
        self.wrap("board", [collage(rng, 128, 40) for _ in range(6)])
        self._put("board", 'type="box" size="0.01 0.06 0.09"', "board")

    def _put(self, name: str, shape: str, material: str) -> None:
        self.add(
            f'<body name="{name}" mocap="true" pos="0 0 -5"><geom name="{name}" {shape} material="{material}"/></body>'
        )


class Stage:
    """One world, from its seed; `view` gives renders from random places, the same for the same seed."""

    def __init__(self, seed: int, samples: int | None = None) -> None:
        self._rng = np.random.default_rng([seed, 7])
        rig = default_rig()
        self._focal_px = _FOCAL_PX
        builder = CrowdBuilder(rig, seed, int(self._rng.choice([0, 0, 4])) if samples is None else samples)
        builder.room()
        builder.furniture()
        builder.targets()
        builder.populate()
        builder.head(2 * np.arctan(0.5 * HEIGHT_PX / _FOCAL_PX), {"left": (0.0, 0.0), "right": (0.0, 0.0)})
        self._model = builder.compile(WIDTH_PX, HEIGHT_PX, 1.0)
        self._data = mujoco.MjData(self._model)
        self._base = self._model.body("rig_base").pos.copy()
        self._light = (
            self._model.vis.headlight.ambient.copy(),
            self._model.vis.headlight.diffuse.copy(),
            self._model.light_diffuse.copy(),
        )
        self._context = mujoco.GLContext(WIDTH_PX, HEIGHT_PX)
        self._context.make_current()
        self._scene = mujoco.MjvScene(self._model, maxgeom=1000)
        self._scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = 0
        self._scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = 0
        self._mjr = mujoco.MjrContext(self._model, mujoco.mjtFontScale.mjFONTSCALE_100)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._mjr)
        self._camera = mujoco.MjvCamera()
        self._camera.type = mujoco.mjtCamera.mjCAMERA_FIXED
        self._look_with("left")

    def _look_with(self, eye: str) -> None:
        self._eye = eye
        self._camera.fixedcamid = self._model.camera(eye).id

    def close(self) -> None:
        """Free the renderer."""
        self._mjr.free()
        self._context.free()

    def views(self, count: int, target_share: float = 0.75) -> Iterator[View]:
        """Give `count` views; in about `target_share` of them at least one cube was placed."""
        given = 0
        while given < count:
            view = self._view(self._rng.random() < target_share)
            if view is not None:
                given += 1
                yield view

    def stereo_views(self, count: int, cubes: int) -> Iterator[StereoView]:
        """Give `count` pairs with `cubes` alike cubes each, some beside each other, none hidden or cut in both eyes."""
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
            self._place(f"alike{number}", rng.random() < 0.2, _width_px(rng))
        self._set("marker", _HIDDEN)
        self._set("board", _HIDDEN)
        self._set_light(float(rng.uniform(0.6, 1.2)))
        images, boxes = [], []
        for eye in ("left", "right"):
            self._look_with(eye)
            mujoco.mj_kinematics(self._model, data)
            mujoco.mj_camlight(self._model, data)
            geoms = self._segmentation()
            labels = {number: self._label(f"cube{number}", geoms) for number in range(cubes)}
            boxes.append({n: np.array(label[0]) for n, label in labels.items() if label and label[1] > 0.6})
            images.append(_webcam(rng, self._render()))
        self._look_with("left")
        if len(boxes[0]) + len(boxes[1]) < 3:
            return None
        angles = (pan_rad, pan_rad + converged_rad, float(data.joint("tilt").qpos[0]))
        return StereoView((images[0], images[1]), (boxes[0], boxes[1]), angles)

    def _view(self, with_cubes: bool) -> View | None:
        rng, data = self._rng, self._data
        self._pose_head()
        for number in range(CUBES):
            # One cube mostly; more of them teach that each is found for itself.
            shown = with_cubes and (number == 0 or rng.random() < 0.15)
            self._place(f"cube{number}", shown, _width_px(rng))
        for number in range(LOOK_ALIKES):
            self._place(f"alike{number}", rng.random() < 0.35, _width_px(rng))
        self._place("marker", rng.random() < 0.15, rng.uniform(10, 60))
        if with_cubes and rng.random() < 0.12:
            self._hide_partly()
        else:
            self._set("board", _HIDDEN)
        self._set_light(float(np.exp(rng.uniform(np.log(0.22), np.log(1.5)))))
        mujoco.mj_kinematics(self._model, data)
        mujoco.mj_camlight(self._model, data)
        boxes, shares, cuts = [], [], []
        geoms = self._segmentation()
        for number in range(CUBES):
            found = self._label(f"cube{number}", geoms)
            if found is None:
                continue
            box, share, cut = found
            if share < _LEAST_SHARE:
                if share < _GONE_SHARE:
                    continue
                return None  # neither an example nor a counterexample
            boxes.append(box)
            shares.append(share)
            cuts.append(cut)
        image = _webcam(rng, self._render())
        return View(image, np.array(boxes, np.float64).reshape(-1, 4), np.array(shares), np.array(cuts, bool))

    def _pose_head(self) -> None:
        rng, data = self._rng, self._data
        data.joint("yaw").qpos[0] = rng.uniform(-np.pi, np.pi) if rng.random() < 0.5 else rng.uniform(-0.5, 0.5)
        data.joint("pan_left").qpos[0] = rng.uniform(-0.6, 0.6)
        data.joint("tilt").qpos[0] = rng.normal(0.05, 0.25)
        self._model.body("rig_base").pos = self._base + rng.uniform([-0.6, -0.8, -0.5], [0.5, 0.8, 0.4])
        mujoco.mj_kinematics(self._model, data)
        mujoco.mj_camlight(self._model, data)

    def _place(self, name: str, shown: bool, width_px: float) -> None:
        """Put a thing where a cube would be `width_px` wide in half-size images, anywhere in the view."""
        rng = self._rng
        if not shown:
            self._set(name, _HIDDEN)
            return
        depth = CUBE_SIDE_M * 0.5 * self._focal_px / width_px
        u, v = rng.uniform(-10, WIDTH_PX + 10), rng.uniform(-10, HEIGHT_PX + 10)
        self._set(name, self._world_of(u, v, depth), _any_rotation(rng))

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

    def _update_scene(self) -> None:
        mujoco.mjv_updateScene(
            self._model,
            self._data,
            mujoco.MjvOption(),
            mujoco.MjvPerturb(),
            self._camera,
            mujoco.mjtCatBit.mjCAT_ALL,
            self._scene,
        )

    def _pixels(self) -> Image:
        rgb = np.empty((HEIGHT_PX, WIDTH_PX, 3), np.uint8)
        viewport = mujoco.MjrRect(0, 0, WIDTH_PX, HEIGHT_PX)
        mujoco.mjr_render(viewport, self._scene, self._mjr)
        mujoco.mjr_readPixels(rgb, None, viewport, self._mjr)
        return rgb[::-1]

    def _render(self) -> Image:
        self._context.make_current()
        self._update_scene()
        return np.ascontiguousarray(self._pixels()[:, :, ::-1])

    def _segmentation(self) -> NDArray[np.int32]:
        """Return for every pixel the geom seen there, -1 for none (480, 640)."""
        self._context.make_current()
        self._update_scene()
        self._scene.flags[mujoco.mjtRndFlag.mjRND_SEGMENT] = 1
        self._scene.flags[mujoco.mjtRndFlag.mjRND_IDCOLOR] = 1
        codes = self._pixels().astype(np.int32)
        self._scene.flags[mujoco.mjtRndFlag.mjRND_SEGMENT] = 0
        self._scene.flags[mujoco.mjtRndFlag.mjRND_IDCOLOR] = 0
        numbers = codes[:, :, 0] + codes[:, :, 1] * 256 + codes[:, :, 2] * 65536
        of_scene = np.full(self._scene.ngeom + 1, -1, np.int32)
        for i in range(self._scene.ngeom):
            geom = self._scene.geoms[i]
            if geom.objtype == mujoco.mjtObj.mjOBJ_GEOM and geom.segid >= 0:
                of_scene[geom.segid + 1] = geom.objid
        return of_scene[np.clip(numbers, 0, self._scene.ngeom)]

    def _label(self, name: str, geoms: NDArray[np.int32]) -> tuple[list[float], float, bool] | None:
        """Return a cube's box, the share of it that is seen, and whether the border cuts it; None out of view."""
        geom = self._model.geom(name).id
        camera = self._data.camera(self._eye)
        signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).T.reshape(-1, 3)
        corners = (
            self._data.geom_xpos[geom]
            + signs * self._model.geom_size[geom] @ np.array(self._data.geom_xmat[geom]).reshape(3, 3).T
        )
        local = (corners - np.array(camera.xpos)) @ np.array(camera.xmat).reshape(3, 3)
        depth = -local[:, 2]
        if (depth < 0.02).any():
            return None
        places = np.column_stack(
            [319.5 + self._focal_px * local[:, 0] / depth, 239.5 - self._focal_px * local[:, 1] / depth]
        )
        outline = np.zeros((HEIGHT_PX, WIDTH_PX), np.uint8)
        cv2.fillConvexPoly(outline, cv2.convexHull(np.rint(places * 16).astype(np.int32)), 1, shift=4)
        inside = int(outline.sum())
        seen = geoms == geom
        count = int(seen.sum())
        if inside < 12:
            return None
        share = min(count / inside, 1.0)
        low, high = places.min(0), places.max(0)
        limit = np.array([WIDTH_PX - 0.5, HEIGHT_PX - 0.5])
        cut = bool((low < -0.5).any() or (high > limit).any())
        if share < _CLEAR_SHARE - 2.0 / np.sqrt(inside) and count:
            rows, columns = np.flatnonzero(seen.any(1)), np.flatnonzero(seen.any(0))
            box = [columns[0] - 0.5, rows[0] - 0.5, columns[-1] + 0.5, rows[-1] + 0.5]
            return [float(v) for v in box], share, cut
        box = [*np.maximum(low, -0.5), *np.minimum(high, limit)]
        return [float(v) for v in box], share, cut


def _width_px(rng: np.random.Generator) -> float:
    return float(np.exp(rng.uniform(np.log(6.5), np.log(75.0))))


def _any_rotation(rng: np.random.Generator) -> Array:
    """Upright as the simulator puts things in four of ten, else any rotation: a unit quaternion (4,)."""
    quaternion = rng.normal(size=4)
    if rng.random() < 0.4:
        turn = rng.uniform(-np.pi, np.pi) if rng.random() < 0.5 else 0.0
        quaternion = np.array([np.cos(turn / 2), 0.0, 0.0, np.sin(turn / 2)])
    return np.asarray(quaternion / np.linalg.norm(quaternion))


def _webcam(rng: np.random.Generator, image: Image) -> Image:
    """Return what a cheap camera makes of it: exposure, white balance, blur, noise, JPEG."""
    gains = rng.uniform(0.75, 1.25) * rng.uniform(0.92, 1.08, 3)
    picture = np.clip(image * gains.astype(np.float32), 0, 255)
    if rng.random() < 0.3:
        picture = cv2.GaussianBlur(picture, (0, 0), rng.uniform(0.4, 1.3))
    noise = rng.standard_normal(picture.shape, dtype=np.float32) * np.float32(rng.uniform(0.0, 6.0))
    picture = np.clip(picture + noise, 0, 255).astype(np.uint8)
    if rng.random() < 0.7:
        _, jpeg = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(65, 96))])
        picture = np.asarray(cv2.imdecode(jpeg, cv2.IMREAD_COLOR), np.uint8)
    return np.asarray(picture, np.uint8)
