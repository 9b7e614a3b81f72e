"""Ground truth of a scene from MuJoCo's own kinematics and ray casting; vergence_rig's kinematics is not used."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import mujoco
import numpy as np
import numpy.typing as npt

from vergence_rig.geometry import EyeAngles, angle_between
from vergence_rig.head_bodies import BASE, EYES, TILT
from vergence_rig.rig import JOINT_NAMES, Rig
from vergence_sim.optics import Lens
from vergence_sim.parameters import TARGETS
from vergence_sim.persons import PERSON_CLASS, PERSONS
from vergence_sim.scene import EXTRA_CUBES
from vergence_sim.true_gaze import TrueGaze

Array = npt.NDArray[np.float64]

_GRID = 6
_SAME_SURFACE_M = 1e-3
# The head's own parts do not occlude.
_OCCLUDING_GROUPS = np.array([1, 1, 1, 0, 0, 0], np.uint8)


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
    """Ground truth at one instant; fields as in TrueVergence.msg. Points are in rig_base [m]."""

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
    left_principal_error_rad: float
    right_principal_error_rad: float
    mean_disparity_px: float
    left_visible_share: float
    right_visible_share: float
    left_px: tuple[float, float]
    right_px: tuple[float, float]


class GroundTruth:
    """Reads a MuJoCo model. Eyes are its cameras `left`, `right` and the sites of their foveas."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, lenses: Mapping[str, Lens], head: Rig) -> None:
        self._model, self._data = model, data
        self._lenses = lenses
        self._gaze = TrueGaze(head)
        self._geoms = {
            name: [
                i
                for i in range(model.ngeom)
                if model.geom_bodyid[i] == mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name)
            ]
            for name in (*TARGETS, *EXTRA_CUBES, *PERSONS)
        }
        self._geoms = {name: geoms for name, geoms in self._geoms.items() if geoms}
        self._hit = np.zeros(1, np.int32)
        self._cameras = {eye: model.camera(eye).id for eye in lenses}

    @property
    def objects(self) -> tuple[str, ...]:
        """Names of the objects that have boxes: targets, extra cubes and persons, visible or not."""
        return tuple(self._geoms)

    def target_point_world(self, target: str) -> Array:
        """Return where the ray from the rig's origin through the target's centre meets its surface (3,), in world."""
        origin = np.array(self._data.body(BASE).xpos)
        centre = np.array(self._data.body(target).xpos)
        direction = centre - origin
        distance = self._cast(origin, direction, self._geoms[target])
        return origin + direction * distance if math.isfinite(distance) else centre

    def evaluate(self, target: str) -> Truth:
        """Return the ground truth about a target; the model's kinematics must be up to date."""
        point = self.target_point_world(target)
        local = self._in_rig(point)
        errors = {eye: self.angle_to_fovea(eye, point) for eye in ("left", "right")}
        vergence_error, version_error, elevation_error = self.axis_errors(point)
        samples, shares = self._samples(target)
        eyes = self.eye_angles()
        return Truth(
            target=target,
            target_point_m=local,
            pan_left_rad=eyes.pan_left_rad,
            pan_right_rad=eyes.pan_right_rad,
            tilt_rad=eyes.tilt_rad,
            vergence_error_rad=vergence_error,
            version_error_rad=version_error,
            elevation_error_rad=elevation_error,
            left_error_rad=errors["left"],
            right_error_rad=errors["right"],
            left_principal_error_rad=self.angle_to_principal_point("left", point),
            right_principal_error_rad=self.angle_to_principal_point("right", point),
            mean_disparity_px=self._mean_disparity(samples),
            left_visible_share=shares["left"],
            right_visible_share=shares["right"],
            left_px=self._lenses["left"].distorted(self.project("left", point)),
            right_px=self._lenses["right"].distorted(self.project("right", point)),
        )

    def mean_disparity(self, target: str, grid: int) -> float:
        """Return the mean disparity [px] of the target's surface that both eyes see, from grid x grid rays per eye."""
        return self._mean_disparity(self._samples(target, grid)[0])

    def project(self, eye: str, point: Array) -> tuple[float, float]:
        """Return the undistorted pixel (x, y) of a world point in an eye's image; NaN behind the eye."""
        ((x, y),) = self._project(eye, np.asarray(point)[None]).tolist()
        return x, y

    def box(self, eye: str, target: str) -> TrueBox | None:
        """Return the true box of an object in an eye's image, cut to it; None where none of it is inside."""
        places = self._project(eye, np.array(self._outline(target)))
        if np.isnan(places).any():
            return None
        places = self._lenses[eye].distorted_points(places)
        width, height = self._lenses[eye].camera.width_px, self._lenses[eye].camera.height_px
        low, high = places.min(axis=0), places.max(axis=0)
        if high[0] < 0 or high[1] < 0 or low[0] > width - 1 or low[1] > height - 1:
            return None
        return TrueBox(
            _class_of(target),
            float(max(low[0], 0)),
            float(max(low[1], 0)),
            float(min(high[0], width - 1)),
            float(min(high[1], height - 1)),
            bool(low[0] < 0),
            bool(low[1] < 0),
            bool(high[0] > width - 1),
            bool(high[1] > height - 1),
        )

    def _project(self, eye: str, points: Array) -> Array:
        """Return the undistorted pixels (N, 2) of world points (N, 3); NaN behind the eye."""
        origin, rotation = self._camera(eye)
        spec = self._lenses[eye].camera
        # MuJoCo's cameras look along -z with y up.
        local = (points - origin) @ rotation * (1.0, -1.0, -1.0)
        depth = np.where(local[:, 2] > 1e-6, local[:, 2], math.nan)[:, None]
        return np.asarray(local[:, :2] / depth * (spec.fx_px, spec.fy_px) + (spec.cx_px, spec.cy_px))

    def _camera(self, eye: str) -> tuple[Array, Array]:
        index = self._cameras[eye]
        return self._data.cam_xpos[index].copy(), self._data.cam_xmat[index].reshape(3, 3).copy()

    def angle_to_fovea(self, eye: str, point: Array) -> float:
        """Return the angle between a world point and an eye's optical axis, as rig.yaml defines it [rad]."""
        site = self._data.site(f"{eye}_fovea")
        return angle_between(np.array(site.xmat).reshape(3, 3)[:, 0], point - np.array(site.xpos))

    def angle_to_principal_point(self, eye: str, point: Array) -> float:
        """Return the angle between a world point and a camera's own axis, that of its principal point [rad]."""
        origin, rotation = self._camera(eye)
        return angle_between(-rotation[:, 2], point - origin)

    def eye_angles(self) -> EyeAngles:
        """Return the angles of both optical axes and the tilt."""
        bar = np.array(self._data.body(TILT).xmat).reshape(3, 3)
        pans = []
        for eye in EYES:
            x, y, _ = bar.T @ np.array(self._data.site(f"{eye}_fovea").xmat).reshape(3, 3)[:, 0]
            pans.append(math.atan2(y, x))
        base = np.array(self._data.body(BASE).xmat).reshape(3, 3)
        x, _, z = (base.T @ bar)[:, 0]
        return EyeAngles(pans[0], pans[1], math.atan2(-z, x))

    def axis_errors(self, point: Array) -> tuple[float, float, float]:
        """Return how much vergence, version and tilt are short of a world point [rad]; NaN where no angles reach it."""
        present = np.array([self._data.joint(name).qpos[0] for name in JOINT_NAMES])
        left, right, tilt = (self._gaze.hinges(self._in_rig(point)) - present).tolist()
        return right - left, 0.5 * (left + right), tilt

    def _in_rig(self, point: Array) -> Array:
        base = self._data.body(BASE)
        return np.asarray(np.array(base.xmat).reshape(3, 3).T @ (point - np.array(base.xpos)))

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

    def _samples(self, target: str, grid: int = _GRID) -> tuple[Array, dict[str, float]]:
        """Return samples (N, 3) of the target's surface that both eyes see, and the share that each eye sees."""
        samples: list[Array] = []
        shares: dict[str, float] = {}
        for eye, other in (("left", "right"), ("right", "left")):
            points = self.surface(eye, target, self._grid(eye, target, grid))
            seen = self.sees(eye, points)
            shares[eye] = float(seen.mean()) if len(points) else 0.0
            samples.append(points[seen][self.sees(other, points[seen])])
        return np.concatenate(samples), shares

    def _grid(self, eye: str, target: str, count: int) -> Array:
        places = self._project(eye, np.array(self._outline(target)))
        if np.isnan(places).any():
            return np.empty((0, 2))
        low, high = places.min(axis=0), places.max(axis=0)
        shares = (np.arange(count) + 0.5) / count
        u, v = np.meshgrid(low[0] + shares * (high[0] - low[0]), low[1] + shares * (high[1] - low[1]))
        return np.column_stack([u.ravel(), v.ravel()])

    def surface(self, eye: str, target: str, pixels: Array) -> Array:
        """Return where the rays of undistorted pixels (N, 2) of an eye meet an object (M, 3), occluded or not."""
        origin, rotation = self._camera(eye)
        spec = self._lenses[eye].camera
        rays = np.column_stack(
            [
                (pixels[:, 0] - spec.cx_px) / spec.fx_px,
                -(pixels[:, 1] - spec.cy_px) / spec.fy_px,
                np.full(len(pixels), -1.0),
            ]
        )
        directions = rays @ rotation.T
        distances = np.array([self._cast(origin, direction, self._geoms[target]) for direction in directions])
        met = np.isfinite(distances)
        return np.asarray(origin + directions[met] * distances[met, None])

    def sees(self, eye: str, points: Array) -> npt.NDArray[np.bool_]:
        """Return which world points (N, 3) lie in an eye's image and are not occluded (N,)."""
        spec = self._lenses[eye].camera
        with np.errstate(invalid="ignore"):
            u, v = self._project(eye, points).T
            inside = (u >= 0) & (u <= spec.width_px - 1) & (v >= 0) & (v <= spec.height_px - 1)
        origin, _ = self._camera(eye)
        lengths = np.linalg.norm(points - origin, axis=1)
        for index in np.flatnonzero(inside):
            direction = (points[index] - origin) / lengths[index]
            nearest = mujoco.mj_ray(self._model, self._data, origin, direction, _OCCLUDING_GROUPS, True, -1, self._hit)
            inside[index] = nearest < 0 or nearest > lengths[index] - _SAME_SURFACE_M
        return inside

    def _mean_disparity(self, samples: Array) -> float:
        if not len(samples):
            return math.nan
        return float((self._project("left", samples)[:, 0] - self._project("right", samples)[:, 0]).mean())

    def _cast(self, origin: Array, direction: Array, geoms: list[int]) -> float:
        """Return the distance to the nearest of `geoms` in lengths of `direction`; inf if the ray meets none."""
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


def _class_of(name: str) -> str:
    if name in EXTRA_CUBES:
        return "cube"
    return PERSON_CLASS if name in PERSONS else name
