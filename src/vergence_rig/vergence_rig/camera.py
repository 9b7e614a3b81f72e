"""The camera model: pixels to rays and back, lens distortion included.

Pixels have their origin at the centre of the top-left pixel, x right, y down. The optical frame has z forward, x right,
y down. Distortion is OpenCV's and ROS's: `plumb_bob` and `rational_polynomial` (4, 5, 8, 12 or 14 coefficients in
OpenCV's order: radial, tangential, thin prism, tilt) and `equidistant` (fisheye, four).
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from vergence_rig.camera_limits import CameraModelError, check_camera

if TYPE_CHECKING:
    from vergence_rig.rig import CameraSpec

__all__ = ["CameraModel", "CameraModelError"]

Array = npt.NDArray[np.float64]

_ITERATIONS = 50
_TOLERANCE = 1e-10
_BENDS_NO_RAY = 1e-9


class CameraModel:
    """Pixels to rays and back for one camera."""

    def __init__(self, spec: "CameraSpec") -> None:
        """Build the model of a camera of rig.yaml."""
        self._set(
            spec.width_px,
            spec.height_px,
            (spec.fx_px, spec.fy_px, spec.cx_px, spec.cy_px),
            spec.distortion,
            "plumb_bob",
        )

    @classmethod
    def from_camera_info_values(
        cls, width: int, height: int, k: Sequence[float], d: Sequence[float], distortion_model: str = "plumb_bob"
    ) -> "CameraModel":
        """Build the model from the values of a sensor_msgs/CameraInfo.

        `k` is the row-major 3x3 intrinsic matrix, `d` the distortion coefficients. Raises CameraModelError for an
        uncalibrated camera (zero focal length) or an unknown distortion model.
        """
        matrix = np.asarray(k, dtype=np.float64).reshape(-1)
        if matrix.shape != (9,):
            raise CameraModelError(f"k must have 9 values, the row-major 3x3 intrinsic matrix: got {matrix.size}")
        model = cls.__new__(cls)
        model._set(width, height, (matrix[0], matrix[4], matrix[2], matrix[5]), d, distortion_model)
        return model

    def _set(
        self, width: int, height: int, intrinsics: Sequence[float], d: Sequence[float], distortion_model: str
    ) -> None:
        self.width_px, self.height_px = int(width), int(height)
        self.fx_px, self.fy_px, self.cx_px, self.cy_px = (float(value) for value in intrinsics)
        if self.width_px <= 0 or self.height_px <= 0:
            raise CameraModelError(f"image size must be at least 1 x 1 [px]: got {width} x {height}")
        coefficients = np.asarray(d, dtype=np.float64).reshape(-1)
        check_camera(self.width_px, self.height_px, intrinsics, coefficients.tolist(), distortion_model)
        self.distortion_model = distortion_model or "plumb_bob"
        self.distortion = coefficients
        self._is_distorted = bool(np.any(coefficients)) or self.distortion_model == "equidistant"
        self._tilt = _tilt_projection(coefficients[12:]) if coefficients.size == 14 else None
        # With a denominator (k4 to k6) the radius has no bound of this form.
        polynomial = self.distortion_model != "equidistant" and not np.any(coefficients[5:8])
        self._limit = _monotone_limit(coefficients) if polynomial else np.inf

    def equals(self, other: "CameraModel") -> bool:
        """Return whether another model maps every pixel alike."""
        mine, others = ((m.width_px, m.height_px, m.fx_px, m.fy_px, m.cx_px, m.cy_px) for m in (self, other))
        if mine != others or self._is_distorted != other._is_distorted:
            return False
        if not self._is_distorted:
            return True
        same = self.distortion_model == other.distortion_model and self.distortion.size == other.distortion.size
        return same and bool((self.distortion == other.distortion).all())

    def undistort(self, uv: Any) -> Array:
        """Return normalised coordinates (N, 2), x/z and y/z, of raw pixels (N, 2); NaN where none exist."""
        pixels = np.atleast_2d(np.asarray(uv, dtype=np.float64))
        distorted = (pixels - (self.cx_px, self.cy_px)) / (self.fx_px, self.fy_px)
        if not self._is_distorted:
            return distorted
        normalised = distorted.copy()
        if self.distortion_model == "equidistant":
            normalised = _start_equidistant(distorted)
        with np.errstate(all="ignore"):
            for _ in range(_ITERATIONS):
                residual = self._distort(normalised) - distorted
                if np.nanmax(np.abs(residual), initial=0.0) < _TOLERANCE:
                    break
                normalised = normalised - _solve(self._jacobian(normalised), residual)
            normalised[~(np.abs(self._distort(normalised) - distorted).max(axis=1) < 1e-6)] = np.nan
        return normalised

    def undistorted(self, u_px: float, v_px: float) -> tuple[float, float]:
        """Return what `undistort` does of one pixel: without distortion without the cost of arrays."""
        if self._is_distorted:
            x, y = self.undistort((u_px, v_px))[0].tolist()
            return x, y
        return (float(u_px) - self.cx_px) / self.fx_px, (float(v_px) - self.cy_px) / self.fy_px

    def distorted(self, x: float, y: float) -> tuple[float, float]:
        """Return what `distort` does of one point, as `undistorted`."""
        if self._is_distorted:
            u_px, v_px = self.distort((x, y))[0].tolist()
            return u_px, v_px
        return x * self.fx_px + self.cx_px, y * self.fy_px + self.cy_px

    def distort(self, normalised: Any) -> Array:
        """Return raw pixels (N, 2) of normalised coordinates (N, 2). NaN beyond the lens model's monotone range."""
        points = np.atleast_2d(np.asarray(normalised, dtype=np.float64))
        distorted = self._distort(points) if self._is_distorted else points
        pixels: Array = distorted * (self.fx_px, self.fy_px) + (self.cx_px, self.cy_px)
        if self._is_distorted and np.isfinite(self._limit):
            pixels[np.hypot(points[:, 0], points[:, 1]) > self._limit] = np.nan
        return pixels

    def pixel_to_ray(self, uv: Any) -> Array:
        """Return unit rays (N, 3) in the optical frame (x right, y down, z forward) of raw pixels (N, 2)."""
        normalised = self.undistort(uv)
        rays = np.column_stack([normalised, np.ones(len(normalised))])
        return rays / np.linalg.norm(rays, axis=1, keepdims=True)

    def ray_to_pixel(self, rays: Any) -> Array:
        """Return raw pixels (N, 2) of rays or points (N, 3) in the optical frame; NaN for those not in front."""
        points = np.atleast_2d(np.asarray(rays, dtype=np.float64))
        with np.errstate(divide="ignore", invalid="ignore"):
            normalised = np.where(points[:, 2:] > 0, points[:, :2] / points[:, 2:], np.nan)
        return self.distort(normalised)

    def angles(self, uv: Any) -> Array:
        """Return azimuth atan(x/z), right positive, and elevation atan(y/z), down positive, (N, 2) [rad]."""
        return np.arctan(self.undistort(uv))

    def contains(self, uv: Any) -> npt.NDArray[np.bool_]:
        """Return which pixels (N, 2) lie in the image, up to the edges of its outermost pixels."""
        pixels = np.atleast_2d(np.asarray(uv, dtype=np.float64))
        inside: npt.NDArray[np.bool_] = (
            (pixels >= -0.5).all(axis=1)
            & (pixels[:, 0] <= self.width_px - 0.5)
            & (pixels[:, 1] <= self.height_px - 0.5)
        )
        return inside

    def _distort(self, points: Array) -> Array:
        x, y = points[:, 0], points[:, 1]
        if self.distortion_model == "equidistant":
            radius = np.hypot(x, y)
            theta = np.arctan(radius)
            square = theta * theta
            k1, k2, k3, k4 = self.distortion
            bent = theta * (1 + square * (k1 + square * (k2 + square * (k3 + square * k4))))
            scale = np.where(radius > 1e-12, bent / np.maximum(radius, 1e-12), 1.0)
            return np.column_stack([x * scale, y * scale])
        k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4 = np.concatenate([self.distortion, np.zeros(12)])[:12]
        square = x * x + y * y
        radial = (1 + square * (k1 + square * (k2 + square * k3))) / (1 + square * (k4 + square * (k5 + square * k6)))
        bent_points = np.column_stack(
            [
                x * radial + 2 * p1 * x * y + p2 * (square + 2 * x * x) + square * (s1 + square * s2),
                y * radial + p1 * (square + 2 * y * y) + 2 * p2 * x * y + square * (s3 + square * s4),
            ]
        )
        if self._tilt is None:
            return bent_points
        tilted = np.column_stack([bent_points, np.ones(len(points))]) @ self._tilt.T
        return np.asarray(tilted[:, :2] / tilted[:, 2:])

    def _jacobian(self, points: Array) -> Array:
        step = 1e-6
        columns = [
            (self._distort(points + offset) - self._distort(points - offset)) / (2 * step)
            for offset in (np.array([step, 0.0]), np.array([0.0, step]))
        ]
        return np.stack(columns, axis=-1)


def _solve(jacobian: Array, residual: Array) -> Array:
    a, b, c, d = jacobian[:, 0, 0], jacobian[:, 0, 1], jacobian[:, 1, 0], jacobian[:, 1, 1]
    determinant = a * d - b * c
    return np.column_stack(
        [
            (d * residual[:, 0] - b * residual[:, 1]) / determinant,
            (a * residual[:, 1] - c * residual[:, 0]) / determinant,
        ]
    )


def _start_equidistant(distorted: Array) -> Array:
    bent = np.hypot(distorted[:, 0], distorted[:, 1])
    radius = np.tan(np.minimum(bent, 1.5))
    return distorted * (radius / np.maximum(bent, 1e-12))[:, None]


def _tilt_projection(tilts_rad: Array) -> Array:
    """Return OpenCV's matTilt (3, 3): the image plane turned about x, then y, and projected along z."""
    (cos_x, cos_y), (sin_x, sin_y) = np.cos(tilts_rad), np.sin(tilts_rad)
    about_x = np.array([[1, 0, 0], [0, cos_x, sin_x], [0, -sin_x, cos_x]])
    about_y = np.array([[cos_y, 0, -sin_y], [0, 1, 0], [sin_y, 0, cos_y]])
    turned = about_y @ about_x
    projection = np.array([[turned[2, 2], 0, -turned[0, 2]], [0, turned[2, 2], -turned[1, 2]], [0, 0, 1]])
    return np.asarray(projection @ turned)


def _monotone_limit(coefficients: Array) -> float:
    """Return the radius up to which the radial polynomial grows: beyond it, points fold back into the image."""
    if coefficients.size == 0 or not np.any(coefficients):
        return np.inf
    k1, k2, k3 = coefficients[0], coefficients[1], coefficients[4] if coefficients.size > 4 else 0.0
    # np.roots divides by the leading coefficient: one that bends no ray would overflow.
    roots = np.roots([value if abs(value) > _BENDS_NO_RAY else 0.0 for value in (7 * k3, 5 * k2, 3 * k1, 1.0)])
    real = roots[np.abs(roots.imag) < 1e-9].real
    return float(np.sqrt(real[real > 0].min())) if np.any(real > 0) else np.inf
