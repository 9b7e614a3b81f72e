"""What the cameras see of a head whose geometry is estimated: pixels of points, and their derivatives.

A view is one eye at one pose; view v of pose p is 2 p for the left eye, 2 p + 1 for the right one. Points are
directions (M, 3) and inverse distances (M,) [1/m] from rig_base: those far away are as smooth as near ones.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vergence_calibration.geometry.unknowns import CAMERA_UNKNOWNS, EYE_UNKNOWNS, HEAD_UNKNOWNS, NAMES
from vergence_calibration.identification.axis_log import EYES, EyeCamera
from vergence_rig.geometry import ROTATION_EYE_FROM_OPTICAL
from vergence_rig.rig import Rig

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]

_PER_EYE = len(EYE_UNKNOWNS)
_CAMERA = _PER_EYE - len(CAMERA_UNKNOWNS)
LOCAL = _PER_EYE + len(HEAD_UNKNOWNS) + 2
"""Number of unknowns that a view depends on: its eye's, the head's, its pan's and its tilt's deviation at the pose."""

_LEAST_DEPTH = 1e-3


@dataclass(frozen=True)
class Poses:
    """Where the joints were, and how they got there.

    joints_rad: (P, 3) reported angles, as JOINT_NAMES.
    arrived: (P, 3) sign of each joint's last motion, 0 if it did not move by more than its play.
    """

    joints_rad: Array
    arrived: Array


@dataclass(frozen=True)
class Observations:
    """N sightings: of which point, in which view, at which pixel (N, 2). A point is in a view at most once."""

    view: Indices
    point: Indices
    pixels: Array

    def kept(self, which: npt.NDArray[np.bool_]) -> "Observations":
        """Return some of the sightings (N,), their points numbered anew."""
        _, point = np.unique(self.point[which], return_inverse=True)
        return Observations(self.view[which], point, self.pixels[which])


@dataclass(frozen=True)
class Points:
    """Unit directions (M, 3) in rig_base and inverse distances (M,) [1/m] from its origin."""

    directions: Array
    inverse_m: Array


@dataclass(frozen=True)
class ViewPoses:
    """Of V views: camera rotations (V, 3, 3) to rig_base, lenses (V, 3), and derivatives by LOCAL unknowns.

    turns: (V, LOCAL, 3) rotation vectors in rig_base; moves: (V, LOCAL, 3) of the lens.
    """

    rotations: Array
    lenses: Array
    turns: Array
    moves: Array


class HeadViews:
    """Projects points into the views of some poses; immutable.

    Args:
        rig: what is kept of it: baseline, pan axes, yaws, mean height of the lenses.
        cameras: by eye, the start of what is estimated of them.
        poses: P of them.
    """

    def __init__(self, rig: Rig, cameras: Mapping[str, EyeCamera], poses: Poses) -> None:
        self.poses = poses
        self.count = 2 * len(poses.joints_rad)
        mounts = [rig.mount(eye == "left") for eye in EYES]
        half_m, mean_z_m = 0.5 * rig.baseline_m, 0.5 * (mounts[0].lens_z_m + mounts[1].lens_z_m)
        mean_x_m = 0.5 * (mounts[0].axis_x_m + mounts[1].axis_x_m)
        self._axes = np.array([(mean_x_m, y, m.axis_z_m) for m, y in zip(mounts, (half_m, -half_m), strict=True)])
        self._yaws = np.array([mount.yaw_rad for mount in mounts])
        self._lens_z = mean_z_m
        self._tilt_zero = rig.tilt.zero_rad
        self._focal = np.array([(cameras[eye].model.fx_px, cameras[eye].model.fy_px) for eye in EYES])
        pose, eye = np.divmod(np.arange(self.count), 2)
        self._pose, self._eye = pose, eye
        first = len(NAMES)
        self.unknowns: Indices = np.column_stack(
            [
                eye[:, None] * _PER_EYE + np.arange(_PER_EYE),
                np.tile(2 * _PER_EYE + np.arange(len(HEAD_UNKNOWNS)), (self.count, 1)),
                first + 3 * pose + eye,
                first + 3 * pose + 2,
            ]
        )
        """Of each view, the places (V, LOCAL) of its unknowns in the vector: NAMES, then every pose's deviations."""

    @property
    def size(self) -> int:
        """Length of the vector of unknowns."""
        return len(NAMES) + 3 * len(self.poses.joints_rad)

    def view_poses(self, vector: Array) -> ViewPoses:
        """Return the cameras' poses and their derivatives for a vector of unknowns (G + 3 P,)."""
        local = vector[self.unknowns]
        lens_x, lens_y, roll, pitch, zero, scale, play = local[:, :7].T
        higher, ahead, tilt_scale, tilt_play, tilt_x, tilt_z = local[:, _PER_EYE:-2].T
        joints, arrived = self.poses.joints_rad[self._pose], self.poses.arrived[self._pose]
        rows = np.arange(self.count)
        pan_joint = joints[rows, self._eye] - arrived[rows, self._eye] * play + local[:, -2]
        tilt_joint = joints[:, 2] - arrived[:, 2] * tilt_play + local[:, -1]
        pan, tilt = zero + scale * pan_joint, self._tilt_zero + tilt_scale * tilt_joint
        bar = _about_y(tilt)
        on_axis = bar @ _about_z(pan)
        with_yaw = on_axis @ _about_z(self._yaws[self._eye])
        with_pitch = with_yaw @ _about_y(pitch)
        rotations = with_pitch @ _about_x(roll) @ ROTATION_EYE_FROM_OPTICAL
        axis = np.column_stack([tilt_x, np.zeros(self.count), tilt_z])
        side = np.where(self._eye == 0, 0.5, -0.5)
        apart = np.column_stack([side * ahead, np.zeros((self.count, 2))])
        pan_axis = axis + np.einsum("vij,vj->vi", bar, self._axes[self._eye] + apart - axis)
        lens = np.column_stack([lens_x, lens_y, self._lens_z + side * higher])
        lenses = pan_axis + np.einsum("vij,vj->vi", on_axis, lens)

        turns, moves = np.zeros((2, self.count, LOCAL, 3))
        moves[:, 0], moves[:, 1] = on_axis[:, :, 0], on_axis[:, :, 1]
        turns[:, 2], turns[:, 3] = with_pitch[:, :, 0], with_yaw[:, :, 1]
        by_pan = np.stack([bar[:, :, 2], np.cross(bar[:, :, 2], lenses - pan_axis)])
        by_tilt = np.stack([bar[:, :, 1], np.cross(bar[:, :, 1], lenses - axis)])
        for place, factor, by in (
            (4, np.ones(self.count), by_pan),
            (5, pan_joint, by_pan),
            (6, -arrived[rows, self._eye] * scale, by_pan),
            (LOCAL - 2, scale, by_pan),
            (_PER_EYE + 2, tilt_joint, by_tilt),
            (_PER_EYE + 3, -arrived[:, 2] * tilt_scale, by_tilt),
            (LOCAL - 1, tilt_scale, by_tilt),
        ):
            turns[:, place], moves[:, place] = factor[:, None] * by[0], factor[:, None] * by[1]
        moves[:, _PER_EYE] = side[:, None] * on_axis[:, :, 2]
        moves[:, _PER_EYE + 1] = side[:, None] * bar[:, :, 0]
        moves[:, _PER_EYE + 4], moves[:, _PER_EYE + 5] = (np.eye(3)[k] - bar[:, :, k] for k in (0, 2))
        return ViewPoses(rotations, lenses, turns, moves)

    def project(self, vector: Array, points: Points, seen: Observations) -> tuple[Array, Array, Array]:
        """Return pixels (N, 2) of the observed points, and d pixel by LOCAL unknowns (N, 2, LOCAL) and point (N, 2, 3).

        A point's three are its direction's two tangents, of `tangents`, and its inverse distance. Points behind a
        camera have NaN pixels.
        """
        poses = self.view_poses(vector)
        eye = self._eye[seen.view]
        rotation, lens = poses.rotations[seen.view], poses.lenses[seen.view]
        direction, inverse = points.directions[seen.point], points.inverse_m[seen.point][:, None]
        apart = direction - inverse * lens
        ray = np.einsum("nji,nj->ni", rotation, apart)
        log_focal, log_aspect, cx, cy, k1, k2, p1, p2 = vector[self.unknowns[seen.view, _CAMERA:_PER_EYE]].T
        depth = np.where(ray[:, 2] > _LEAST_DEPTH, ray[:, 2], np.nan)
        x, y = ray[:, 0] / depth, ray[:, 1] / depth
        square = x * x + y * y
        bend, slope = 1.0 + square * (k1 + square * k2), 2.0 * (k1 + 2.0 * square * k2)
        focal = self._focal[eye] * np.exp(np.column_stack([log_focal, log_focal + log_aspect]))
        flat = np.column_stack([x, y])
        by_p1, by_p2 = (
            np.column_stack([2 * x * y, square + 2 * y * y]),
            np.column_stack([square + 2 * x * x, 2 * x * y]),
        )
        bent = flat * bend[:, None] + p1[:, None] * by_p1 + p2[:, None] * by_p2
        pixels = focal * bent + np.column_stack([cx, cy])

        # d pixel / d ray, (N, 2, 3)
        both = 2 * p1 * x + 2 * p2 * y
        tangential = np.stack([2 * p1 * y + 6 * p2 * x, both, both, 6 * p1 * y + 2 * p2 * x], axis=1).reshape(-1, 2, 2)
        radial = bend[:, None, None] * np.eye(2) + slope[:, None, None] * flat[:, :, None] * flat[:, None, :]
        by_flat = focal[:, :, None] * (radial + tangential)
        by_ray = np.concatenate([by_flat, -np.einsum("nij,nj->ni", by_flat, flat)[:, :, None]], axis=2)
        by_rig = np.einsum("nij,nkj->nik", by_ray / depth[:, None, None], rotation)
        # A camera turned by w sees v x w; one moved by m sees the point moved by -inverse m.
        shift = np.cross(apart[:, None, :], poses.turns[seen.view]) - inverse[:, :, None] * poses.moves[seen.view]
        by_view = np.einsum("nij,nkj->nik", by_rig, shift)
        by_view[:, :, _CAMERA], by_view[:, 1, _CAMERA + 1] = focal * bent, (focal * bent)[:, 1]
        by_view[:, 0, _CAMERA + 2], by_view[:, 1, _CAMERA + 3] = 1.0, 1.0
        by_view[:, :, _CAMERA + 4] = focal * flat * square[:, None]
        by_view[:, :, _CAMERA + 5] = focal * flat * (square * square)[:, None]
        by_view[:, :, _CAMERA + 6], by_view[:, :, _CAMERA + 7] = focal * by_p1, focal * by_p2
        along = tangents(points.directions)[seen.point]
        by_point = np.concatenate(
            [np.einsum("nij,njk->nik", by_rig, along), -np.einsum("nij,nj->ni", by_rig, lens)[:, :, None]], axis=2
        )
        return pixels, by_view, by_point

    def rays(self, vector: Array, seen: Observations) -> Array:
        """Return unit rays (N, 3) in rig_base of the observed pixels, without lens distortion."""
        poses = self.view_poses(vector)
        log_focal, log_aspect, cx, cy = vector[self.unknowns[seen.view, _CAMERA : _CAMERA + 4]].T
        scales = np.exp(np.column_stack([log_focal, log_focal + log_aspect]))
        focal = self._focal[self._eye[seen.view]] * scales
        flat = (seen.pixels - np.column_stack([cx, cy])) / focal
        rays = np.einsum("nij,nj->ni", poses.rotations[seen.view], np.column_stack([flat, np.ones(len(flat))]))
        return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))


def tangents(directions: Array) -> Array:
    """Return two unit vectors across each direction, (M, 3, 2)."""
    helper = np.where(np.abs(directions[:, 2:]) < 0.9, np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0]))
    first = np.cross(helper, directions)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, np.cross(directions, first)], axis=2)


def moved(points: Points, step: Array) -> Points:
    """Return the points after a step (M, 3): along both tangents, and in inverse distance [1/m]."""
    directions = points.directions + np.einsum("mij,mj->mi", tangents(points.directions), step[:, :2])
    return Points(directions / np.linalg.norm(directions, axis=1, keepdims=True), points.inverse_m + step[:, 2])


def _about_x(angle: Array) -> Array:
    one, zero, cos, sin = np.ones_like(angle), np.zeros_like(angle), np.cos(angle), np.sin(angle)
    return _matrices([one, zero, zero, zero, cos, -sin, zero, sin, cos])


def _about_y(angle: Array) -> Array:
    one, zero, cos, sin = np.ones_like(angle), np.zeros_like(angle), np.cos(angle), np.sin(angle)
    return _matrices([cos, zero, sin, zero, one, zero, -sin, zero, cos])


def _about_z(angle: Array) -> Array:
    one, zero, cos, sin = np.ones_like(angle), np.zeros_like(angle), np.cos(angle), np.sin(angle)
    return _matrices([cos, -sin, zero, sin, cos, zero, zero, zero, one])


def _matrices(entries: list[Array]) -> Array:
    return np.stack(entries, axis=-1).reshape(-1, 3, 3)
