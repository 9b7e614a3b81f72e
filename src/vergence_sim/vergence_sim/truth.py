"""The truth of a scene from MuJoCo's own kinematics and ray casting; nothing of vergence_rig's geometry is used."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import mujoco
import numpy as np
import numpy.typing as npt

from vergence_sim.optics import Lens
from vergence_sim.parameters import TARGETS
from vergence_sim.scene import EXTRA_CUBES

Array = npt.NDArray[np.float64]

_GRID = 6
_SAME_SURFACE_M = 1e-3
# What the head itself is made of hides nothing from its own eyes.
_SEEN_GROUPS = np.array([1, 1, 1, 0, 0, 0], np.uint8)


@dataclass(frozen=True)
class TrueBox:
    """An object's box in one eye's image, as the lens distorts it [px]. `name` is its class."""

    name: str
    x_min_px: float
    y_min_px: float
    x_max_px: float
    y_max_px: float
    cut_left: bool
    cut_top: bool
    cut_right: bool
    cut_bottom: bool


@dataclass(frozen=True)
class Truth:
    """What is true at one instant; fields as in TrueVergence.msg. Points are in rig_base [m]."""

    target: str
    target_point_m: Array
    pan_left_rad: float
    pan_right_rad: float
    tilt_rad: float
    vergence_error_rad: float
    version_error_rad: float
    elevation_error_rad: float
    left_error_rad: float
    right_error_rad: float
    mean_disparity_px: float
    left_visible_share: float
    right_visible_share: float
    left_px: tuple[float, float]
    right_px: tuple[float, float]


class TruthTeller:
    """Asks a MuJoCo model where things are. Eyes are the bodies `left_camera`, `right_camera` and their cameras."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, lenses: Mapping[str, Lens]) -> None:
        self._model, self._data = model, data
        self._lenses = lenses
        self._geoms = {
            name: [
                i
                for i in range(model.ngeom)
                if model.geom_bodyid[i] == mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name)
            ]
            for name in (*TARGETS, *EXTRA_CUBES)
        }
        self._geoms = {name: geoms for name, geoms in self._geoms.items() if geoms}
        self._hit = np.zeros(1, np.int32)

    @property
    def objects(self) -> tuple[str, ...]:
        """What there are boxes of: the targets and further cubes, seen or not."""
        return tuple(self._geoms)

    def target_point_world(self, target: str) -> Array:
        """Return where the ray from the rig's origin through the target's centre meets the target's surface (3,)."""
        origin = np.array(self._data.body("rig_base").xpos)
        centre = np.array(self._data.body(target).xpos)
        direction = centre - origin
        distance = self._cast(origin, direction, self._geoms[target])
        return origin + direction * distance if math.isfinite(distance) else centre

    def look(self, target: str, joints_rad: dict[str, float]) -> Truth:
        """Return the truth about a target; the model's kinematics must be up to date."""
        data = self._data
        base = data.body("rig_base")
        point = self.target_point_world(target)
        local = np.array(base.xmat).reshape(3, 3).T @ (point - np.array(base.xpos))
        errors = {eye: self._eye_error(eye, point) for eye in ("left", "right")}
        vergence_error, version_error, elevation_error = self.axis_errors(point)
        samples, shares = self._samples(target)
        return Truth(
            target=target,
            target_point_m=local,
            pan_left_rad=joints_rad["pan_left"],
            pan_right_rad=joints_rad["pan_right"],
            tilt_rad=joints_rad["tilt"],
            vergence_error_rad=vergence_error,
            version_error_rad=version_error,
            elevation_error_rad=elevation_error,
            left_error_rad=errors["left"],
            right_error_rad=errors["right"],
            mean_disparity_px=self._mean_disparity(samples),
            left_visible_share=shares["left"],
            right_visible_share=shares["right"],
            left_px=self._lenses["left"].distorted(self.project("left", point)),
            right_px=self._lenses["right"].distorted(self.project("right", point)),
        )

    def project(self, eye: str, point: Array) -> tuple[float, float]:
        """Return where a world point is in an eye's image, before its lens distorts it [px]; NaN behind it."""
        x, y, depth = self._in_camera(eye, point)
        if depth <= 1e-6:
            return math.nan, math.nan
        camera = self._lenses[eye].camera
        return camera.cx_px + camera.fx_px * x / depth, camera.cy_px + camera.fy_px * y / depth

    def box(self, eye: str, target: str) -> TrueBox | None:
        """Return the true box of an object in an eye's image, cut to it; None where none of it is inside."""
        places = np.array([self.project(eye, point) for point in self._outline(target)])
        if np.isnan(places).any():
            return None
        places = self._lenses[eye].distorted_points(places)
        width, height = self._lenses[eye].camera.width_px, self._lenses[eye].camera.height_px
        low, high = places.min(axis=0), places.max(axis=0)
        if high[0] < 0 or high[1] < 0 or low[0] > width - 1 or low[1] > height - 1:
            return None
        return TrueBox(
            "cube" if target in EXTRA_CUBES else target,
            float(max(low[0], 0)),
            float(max(low[1], 0)),
            float(min(high[0], width - 1)),
            float(min(high[1], height - 1)),
            bool(low[0] < 0),
            bool(low[1] < 0),
            bool(high[0] > width - 1),
            bool(high[1] > height - 1),
        )

    def _in_camera(self, eye: str, point: Array) -> tuple[float, float, float]:
        camera = self._data.camera(eye)
        # MuJoCo's cameras look along -z with y up.
        x, y, z = np.array(camera.xmat).reshape(3, 3).T @ (point - np.array(camera.xpos))
        return float(x), float(-y), float(-z)

    def _eye_error(self, eye: str, point: Array) -> float:
        body = self._data.body(f"{eye}_camera")
        axis = np.array(body.xmat).reshape(3, 3)[:, 0]
        ray = point - np.array(body.xpos)
        return math.acos(max(-1.0, min(1.0, float(axis @ ray) / float(np.linalg.norm(ray)))))

    def axis_errors(self, point: Array) -> tuple[float, float, float]:
        """Return how much vergence, version and tilt are short of the target [rad], in the tilt bar's own axes."""
        bar = self._data.body("tilt_bar")
        rotation = np.array(bar.xmat).reshape(3, 3)
        wanted, present = {}, {}
        for eye in ("left", "right"):
            body = self._data.body(f"{eye}_camera")
            ray = rotation.T @ (point - np.array(body.xpos))
            axis = rotation.T @ np.array(body.xmat).reshape(3, 3)[:, 0]
            # In the plane through the eyes and the target, in which the eyes would pan once the tilt is right.
            wanted[eye] = math.atan2(ray[1], math.hypot(ray[0], ray[2]))
            present[eye] = math.atan2(axis[1], axis[0])
        middle = rotation.T @ (point - np.array(bar.xpos))
        elevation = math.atan2(-middle[2], middle[0])
        vergence = (wanted["right"] - wanted["left"]) - (present["right"] - present["left"])
        version = 0.5 * (wanted["left"] + wanted["right"]) - 0.5 * (present["left"] + present["right"])
        return vergence, version, elevation

    def _outline(self, target: str) -> list[Array]:
        points = []
        for geom in self._geoms[target]:
            size = self._model.geom_size[geom]
            box = self._model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_BOX
            if box:
                corners = [
                    np.array(c) * size for c in np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).T.reshape(-1, 3)
                ]
            else:
                turns = np.linspace(0, 2 * math.pi, 24, endpoint=False)
                corners = [
                    np.array([size[0] * math.cos(t), size[0] * math.sin(t), end * size[1]])
                    for t in turns
                    for end in (-1, 1)
                ]
            rotation = np.array(self._data.geom_xmat[geom]).reshape(3, 3)
            points += [np.array(self._data.geom_xpos[geom]) + rotation @ corner for corner in corners]
        return points

    def _samples(self, target: str) -> tuple[list[Array], dict[str, float]]:
        """Sample the target's surface through both eyes' images: points, and who sees them."""
        samples: list[Array] = []
        shares: dict[str, float] = {}
        for eye, other in (("left", "right"), ("right", "left")):
            places = np.array([self.project(eye, point) for point in self._outline(target)])
            seen = total = 0
            if not np.isnan(places).any():
                low, high = places.min(axis=0), places.max(axis=0)
                for u in np.linspace(low[0], high[0], 2 * _GRID + 1)[1::2]:
                    for v in np.linspace(low[1], high[1], 2 * _GRID + 1)[1::2]:
                        point = self._surface(eye, target, u, v)
                        if point is None:
                            continue
                        total += 1
                        if not self._sees(eye, point):
                            continue
                        seen += 1
                        if self._sees(other, point):
                            samples.append(point)
            shares[eye] = seen / total if total else 0.0
        return samples, shares

    def _surface(self, eye: str, target: str, u: float, v: float) -> Array | None:
        camera, spec = self._data.camera(eye), self._lenses[eye].camera
        ray = np.array([(u - spec.cx_px) / spec.fx_px, -(v - spec.cy_px) / spec.fy_px, -1.0])
        direction = np.array(camera.xmat).reshape(3, 3) @ ray
        origin = np.array(camera.xpos)
        distance = self._cast(origin, direction, self._geoms[target])
        return origin + direction * distance if math.isfinite(distance) else None

    def _sees(self, eye: str, point: Array) -> bool:
        u, v = self.project(eye, point)
        spec = self._lenses[eye].camera
        if not (0 <= u <= spec.width_px - 1 and 0 <= v <= spec.height_px - 1):
            return False
        origin = np.array(self._data.camera(eye).xpos)
        direction = point - origin
        length = float(np.linalg.norm(direction))
        nearest = mujoco.mj_ray(self._model, self._data, origin, direction / length, _SEEN_GROUPS, True, -1, self._hit)
        return nearest < 0 or nearest > length - _SAME_SURFACE_M

    def _mean_disparity(self, samples: list[Array]) -> float:
        values = [self.project("left", point)[0] - self.project("right", point)[0] for point in samples]
        return float(np.mean(values)) if values else math.nan

    def _cast(self, origin: Array, direction: Array, geoms: list[int]) -> float:
        """Return how far along `direction` the nearest of `geoms` lies, in its lengths; inf if it meets none."""
        nearest = math.inf
        for geom in geoms:
            kind = int(self._model.geom_type[geom])
            distance = mujoco.mju_rayGeom(
                self._data.geom_xpos[geom],
                self._data.geom_xmat[geom],
                self._model.geom_size[geom],
                origin,
                direction,
                kind,
            )
            if 0 <= distance < nearest:
                nearest = float(distance)
        return nearest
