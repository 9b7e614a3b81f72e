"""A head's geometry found by looking: poses, features, one bundle adjustment, and whether its result can be used."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
import numpy.typing as npt

from vergence_calibration.eye_turn import Image
from vergence_calibration.geometry.acceptance import (
    check_agreement,
    check_certain,
    check_joints,
    check_sightings,
    check_texture,
)
from vergence_calibration.geometry.bundle import BundleAdjustment, Constraint, Solution
from vergence_calibration.geometry.features import Features, features, matches, neighbours, tracks
from vergence_calibration.geometry.poses import PoseParameters, planned_poses, visited
from vergence_calibration.geometry.refinement import refined
from vergence_calibration.geometry.unknowns import NAMES, Prior, index, prior_of, rig_of
from vergence_calibration.geometry.views import HeadViews, Observations, Poses
from vergence_calibration.identification.axis_log import EYES, EyeCamera, IdentifyError
from vergence_rig.camera import CameraModel
from vergence_rig.rig import JOINT_NAMES, Rig

Array = npt.NDArray[np.float64]

_STEP_SIGMAS = 0.1  # by which each unknown is changed for a derivative
_NEIGHBOURS = 10
_LEARNT = 0.7  # of the prior's standard deviation: what remains more uncertain was not seen
_LEAST_JOINT_SIGMA_RAD = math.radians(0.02)
_MAY_BE_UNSEEN = (
    *(f"{eye}.{name}" for eye in EYES for name in ("log_aspect", "k1", "k2", "p1", "p2")),
    "lens_z_apart_m",
    "axis_x_apart_m",
    "tilt_scale",
    "tilt_axis_x_m",
    "tilt_axis_z_m",
)


@dataclass(frozen=True)
class Look:
    """One pose: reported joint angles (3,) as JOINT_NAMES, grey pictures by eye, sizes (w, h) of the whole images."""

    joints_rad: Sequence[float]
    pictures: Mapping[str, Image]
    sizes_px: Mapping[str, tuple[int, int]]


class LookingHead(Protocol):
    """A head that turns to a pose and looks from there."""

    def cameras(self) -> Mapping[str, EyeCamera]:
        """Return the cameras by eye. Raises IdentifyError."""

    def look(self, joints_rad: Mapping[str, float]) -> Look:
        """Turn the joints, and return what both eyes see once they rest. Raises IdentifyError."""


@dataclass(frozen=True)
class FoundGeometry:
    """The result; `values` and `sigmas` (G,) are of the NAMES, residuals are medians over all sightings.

    `kept` names what the images did not show: it has the start's values. `cameras` are the start's, for whole images.
    """

    rig: Rig
    cameras: Mapping[str, EyeCamera]
    values: Array
    sigmas: Array
    kept: tuple[str, ...]
    poses: int
    points: int
    residual_before_px: float
    residual_px: float

    def of(self, name: str, eye: str = "") -> tuple[float, float]:
        """Return an unknown's value and standard deviation."""
        place = index(name, eye)
        return float(self.values[place]), float(self.sigmas[place])


def identify_geometry(
    head: LookingHead,
    rig: Rig,
    parameters: PoseParameters,
    constraints: tuple[Constraint, ...] = (),
    progress: Callable[[str], None] = lambda text: None,
) -> FoundGeometry:
    """Turn the head to many poses and return the geometry that explains what its eyes saw.

    Args:
        head: at rest, commanded by no other node, before things that do not move.
        rig: the start; its limits hold.
        parameters: of the poses.
        constraints: what else is known, of stereo.yaml.
        progress: called with every line of progress.

    Raises:
        IdentifyError: limits too close together, a scene with too little texture or depth, or one that moves.
    """
    first, *planned = planned_poses(rig, parameters)
    progress(f"geometry: looking from {len(planned)} poses")
    cameras = head.cameras()
    look = head.look(first)
    cameras = {eye: _sized(cameras[eye], look.sizes_px[eye], eye) for eye in EYES}
    found: list[Features] = []
    pictures: list[Image] = []
    joints_rad = [[float(angle) for angle in look.joints_rad]]
    for pose in planned:
        look = head.look(pose)
        joints_rad.append([float(angle) for angle in look.joints_rad])
        pictures += [look.pictures[eye] for eye in EYES]
        found += [features(look.pictures[eye]) for eye in EYES]
        scales = [look.sizes_px[eye][0] / look.pictures[eye].shape[1] for eye in EYES]
    check_texture(found)
    poses = visited(rig, joints_rad[1:], joints_rad[0])
    sightings = _tracked(found, rig, cameras, poses)
    whole = _in_whole_images(sightings, scales, cameras)
    known = np.asarray(np.isfinite(whole).all(axis=1))
    sightings = sightings.kept(known)
    seen = replace(sightings, pixels=whole[known])
    check_sightings(seen, len(found))
    progress(f"  {int(seen.point.max()) + 1} things found again from several poses, {len(seen.view)} sightings")

    def refine(by_direction: Array) -> Observations:
        fitting = refined(pictures, sightings, by_direction / np.asarray(scales)[sightings.view % 2, None, None])
        check_sightings(fitting, len(found))
        progress(f"  in {len(fitting.view)} of them one patch of each thing fits")
        return replace(fitting, pixels=_in_whole_images(fitting, scales, cameras))

    return solved(rig, cameras, poses, seen, constraints, refine)


def solved(
    rig: Rig,
    cameras: Mapping[str, EyeCamera],
    poses: Poses,
    seen: Observations,
    constraints: tuple[Constraint, ...] = (),
    refine: Callable[[Array], Observations] | None = None,
) -> FoundGeometry:
    """Return the geometry that explains sightings, as `identify_geometry`. Raises IdentifyError.

    `refine` returns the sightings anew by how they move with their directions (N, 2, 2), `project`'s of a first result.
    """
    views = HeadViews(rig, cameras, poses)
    prior = prior_of(rig, cameras)
    before = BundleAdjustment(views, seen, prior, points_only=True)
    before_px = float(np.median(before.solve(*before.start()).residuals_px))
    adjustment = BundleAdjustment(views, seen, prior, constraints)
    solution = adjustment.solve(*adjustment.start())
    check_agreement(solution)
    check_joints(prior, solution)
    if refine is not None:
        _, _, by_point = views.project(solution.vector, solution.points, seen)
        seen = refine(by_point[:, :, :2])
        adjustment = BundleAdjustment(views, seen, prior, constraints)
        solution = adjustment.solve(*adjustment.start())
    kept = _not_seen(prior, solution)
    learnt = replace(
        prior,
        sigmas=np.where(np.isin(NAMES, kept), 0.0, prior.sigmas),
        joint_sigma_rad=_joint_sigmas(solution),
    )
    adjustment = BundleAdjustment(views, seen, learnt, constraints)
    vector = solution.vector.copy()
    for name in kept:
        vector[NAMES.index(name)] = prior.means[NAMES.index(name)]
    solution = adjustment.solve(vector, solution.points)
    sigmas = np.sqrt(np.diag(solution.covariance))
    check_certain(sigmas)
    return FoundGeometry(
        replace(
            rig_of(rig, solution.vector[: len(NAMES)], cameras),
            zero_sigma_rad=_pan_sigma_rad(views, solution),
            baseline_sigma_m=_baseline_sigma_m(solution),
        ),
        cameras,
        solution.vector[: len(NAMES)],
        sigmas,
        kept,
        len(poses.joints_rad),
        int(seen.point.max()) + 1,
        before_px,
        float(np.median(solution.residuals_px)),
    )


def _tracked(found: Sequence[Features], rig: Rig, cameras: Mapping[str, EyeCamera], poses: Poses) -> Observations:
    """Return the tracks through all views; those are matched that look in much the same direction by the start."""
    views = HeadViews(rig, cameras, poses)
    start = np.concatenate([prior_of(rig, cameras).means, np.zeros(views.size - len(NAMES))])
    axes = views.view_poses(start).rotations[:, :, 2]
    pairs = [(a, b, matches(found[a], found[b])) for a, b in neighbours(axes, _NEIGHBOURS)]
    return tracks(found, pairs)


def _in_whole_images(seen: Observations, scales: Sequence[float], cameras: Mapping[str, EyeCamera]) -> Array:
    """Return pixels (N, 2) of the whole images, without the lens distortion of calibrated cameras; NaN beyond it."""
    pixels = (seen.pixels + 0.5) * np.asarray(scales)[seen.view % 2, None] - 0.5
    for number, eye in enumerate(EYES):
        if cameras[eye].calibrated:
            mine, model = seen.view % 2 == number, cameras[eye].model
            pixels[mine] = model.undistort(pixels[mine]) * (model.fx_px, model.fy_px) + (model.cx_px, model.cy_px)
    return pixels


def _sized(camera: EyeCamera, size_px: tuple[int, int], eye: str) -> EyeCamera:
    """Return the camera for images of this size (w, h). Raises IdentifyError for a calibration of another shape."""
    (width, height), model = size_px, camera.model
    if (width, height) == (model.width_px, model.height_px):
        return camera
    grown = width / model.width_px
    if camera.calibrated and abs(height / model.height_px / grown - 1.0) > 0.02:
        raise IdentifyError(
            f"no calibration for images of {width}x{height} px: camera_info of the {eye} camera is for "
            f"{model.width_px}x{model.height_px} px; calibrate the camera in its running mode"
        )
    centre = ((model.cx_px + 0.5) * grown - 0.5, (model.cy_px + 0.5) * grown - 0.5)
    if not camera.calibrated:
        centre = (0.5 * (width - 1), 0.5 * (height - 1))
    k = [model.fx_px * grown, 0.0, centre[0], 0.0, model.fy_px * grown, centre[1], 0.0, 0.0, 1.0]
    distortion = [float(value) for value in model.distortion]
    return replace(
        camera, model=CameraModel.from_camera_info_values(width, height, k, distortion, model.distortion_model)
    )


def _not_seen(prior: Prior, solution: Solution) -> tuple[str, ...]:
    sigmas = np.sqrt(np.diag(solution.covariance))
    return tuple(
        name
        for name, sigma, known in zip(NAMES, sigmas, prior.sigmas, strict=True)
        if name in _MAY_BE_UNSEEN and sigma > _LEARNT * known > 0
    )


def _joint_sigmas(solution: Solution) -> Array:
    """Return the standard deviation (3,) of each joint at rest, from how far it was from joint_states at the poses.

    Three degrees of freedom of each joint's deviations are its zero, scale and play.
    """
    deviations = solution.vector[len(NAMES) :].reshape(-1, len(JOINT_NAMES))
    return np.maximum(np.sqrt((deviations**2).sum(axis=0) / (len(deviations) - 3)), _LEAST_JOINT_SIGMA_RAD)


def _baseline_sigma_m(solution: Solution) -> float:
    """Return the standard deviation of the distance between the lenses; that between the pan axes was given [m]."""
    places = [index("lens_y_m", eye) for eye in EYES]
    own = solution.covariance[np.ix_(places, places)]
    return round(math.sqrt(max(float(own[0, 0] + own[1, 1] - 2.0 * own[0, 1]), 0.0)), 6)


def _pan_sigma_rad(views: HeadViews, solution: Solution) -> float:
    """Return the standard deviation of each pan that gives that of the vergence, over all poses [rad].

    The vergence is that of the rays of two pixels, which zeros, scales and principal points turn alike.
    """
    principal = solution.vector[[[index(name, eye) for name in ("cx_px", "cy_px")] for eye in EYES]]
    views_at = np.arange(views.count)
    seen = Observations(views_at, np.zeros_like(views_at), np.tile(principal, (views.count // 2, 1)))
    rays = views.rays(solution.vector, seen)
    across = np.cross((0.0, 0.0, 1.0), rays)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    turns = np.zeros((len(NAMES), views.count))
    for place, step in enumerate(_STEP_SIGMAS * np.sqrt(np.diag(solution.covariance))):
        if step > 0.0:
            vector = solution.vector.copy()
            vector[place] += step
            turns[place] = np.einsum("vi,vi->v", views.rays(vector, seen) - rays, across) / step
    vergences = turns[:, 1::2] - turns[:, ::2]
    variances = np.einsum("gp,gh,hp->p", vergences, solution.covariance, vergences)
    return round(math.sqrt(0.5 * float(variances.mean())), 6)
