"""An eye's image as an ideal camera on its mount would take it: the fovea in the middle, rows level with the pan plane.

A turn of a camera about its optical centre maps its image exactly, whatever the depth. So roll, the difference of the
two pitches, lens distortion, principal point and focal length of each eye are taken out of the images once, where they
arrive, and everything after that sees two equal cameras without distortion whose principal points are their middles.
"""

import math

import numpy as np
import numpy.typing as npt

from vergence_rig.camera import CameraModel
from vergence_rig.geometry import ROTATION_EYE_FROM_OPTICAL, rotation_rig_from_eye
from vergence_rig.kinematics import rotation_pan_from_camera
from vergence_rig.rig import CameraSpec, Rig

Array = npt.NDArray[np.float64]

_OUTSIDE_PX = -1e4


class EyeImage:
    """Maps a camera's pixels to those of the ideal image, and back.

    Args:
        camera: the camera as it is.
        ideal: the ideal camera.
        camera_from_ideal: rotation (3, 3) from the ideal camera's optical frame to the camera's.
    """

    def __init__(self, camera: CameraModel, ideal: CameraModel, camera_from_ideal: Array) -> None:
        self.camera, self.ideal = camera, ideal
        self._turn = camera_from_ideal
        self._columns = tuple(camera_from_ideal.T.tolist())
        self.is_same = camera.equals(ideal) and bool(np.allclose(camera_from_ideal, np.eye(3), atol=1e-9))
        """True where the camera's image is the ideal one."""

    def to_ideal(self, pixels: npt.ArrayLike) -> Array:
        """Return ideal pixels (N, 2) of the camera's (N, 2); NaN for those that the ideal camera cannot see."""
        if self.is_same:
            return np.atleast_2d(np.asarray(pixels, dtype=np.float64))
        return self.ideal.ray_to_pixel(self.camera.pixel_to_ray(pixels) @ self._turn)

    def to_camera(self, pixels: npt.ArrayLike) -> Array:
        """Return the camera's pixels (N, 2) of ideal ones (N, 2); NaN where the lens model has none."""
        if self.is_same:
            return np.atleast_2d(np.asarray(pixels, dtype=np.float64))
        return self.camera.ray_to_pixel(self.ideal.pixel_to_ray(pixels) @ self._turn.T)

    @property
    def fx_px(self) -> float:
        """Focal length of the ideal camera [px]."""
        return self.ideal.fx_px

    def undistort(self, pixels: npt.ArrayLike) -> Array:
        """Return normalised coordinates (N, 2), x right, y down, in the ideal camera of the camera's pixels (N, 2)."""
        return self.ideal.undistort(self.to_ideal(pixels))

    def undistorted(self, u_px: float, v_px: float) -> tuple[float, float]:
        """Return what `undistort` does of one pixel, without the cost of arrays."""
        x, y = self.camera.undistorted(u_px, v_px)
        if self.is_same:
            return x, y
        right, down, forward = (x * one + y * two + three for one, two, three in self._columns)
        return (right / forward, down / forward) if forward > 0.0 else (math.nan, math.nan)

    def distort(self, normalised: npt.ArrayLike) -> Array:
        """Return the camera's pixels (N, 2) of normalised coordinates (N, 2) in the ideal camera."""
        return self.to_camera(self.ideal.distort(normalised))

    def maps(self) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
        """Return the camera's x and y (h, w) of every pixel of the ideal image, for cv2.remap."""
        shape = (self.ideal.height_px, self.ideal.width_px)
        rows, columns = np.indices(shape, dtype=np.float64)
        found = self.to_camera(np.column_stack([columns.ravel(), rows.ravel()]))
        placed = np.nan_to_num(found, nan=_OUTSIDE_PX).astype(np.float32).reshape(*shape, 2)
        return np.ascontiguousarray(placed[:, :, 0]), np.ascontiguousarray(placed[:, :, 1])


def described_camera(spec: CameraSpec, width_px: int, height_px: int) -> CameraModel | None:
    """Return the camera that a rig describes, for images of this size; None where their shape is another.

    A camera delivers its image in several sizes: intrinsics are proportional to it.
    """
    if width_px * spec.height_px != height_px * spec.width_px or width_px < 1:
        return None
    scale = width_px / spec.width_px
    focal = (spec.fx_px * scale, spec.fy_px * scale)
    centre = ((spec.cx_px + 0.5) * scale - 0.5, (spec.cy_px + 0.5) * scale - 0.5)
    return CameraModel(CameraSpec(width_px, height_px, *focal, *centre, spec.distortion))


def eye_images(rig: Rig, cameras: tuple[CameraModel, CameraModel]) -> tuple[EyeImage, EyeImage]:
    """Return both eyes' ideal images. They are as large as the smaller camera's, with its focal length.

    Cameras of one size have the geometric mean of their focal lengths.
    """
    left, right = cameras
    sizes = [(camera.width_px, camera.height_px) for camera in cameras]
    if sizes[0] == sizes[1]:
        focal_px = math.prod((left.fx_px, left.fy_px, right.fx_px, right.fy_px)) ** 0.25
        if all(abs(focal - focal_px) < 1e-9 * focal_px for focal in (left.fx_px, left.fy_px, right.fx_px)):
            focal_px = left.fx_px
        size = sizes[0]
    else:
        smaller = min(cameras, key=lambda camera: camera.width_px * camera.height_px)
        focal_px, size = math.sqrt(smaller.fx_px * smaller.fy_px), (smaller.width_px, smaller.height_px)
    spec = CameraSpec(*size, focal_px, focal_px, 0.5 * (size[0] - 1), 0.5 * (size[1] - 1))
    ideal = CameraModel(spec)
    pan_from_ideal = rotation_rig_from_eye(0.0, rig.mean_pitch_rad) @ ROTATION_EYE_FROM_OPTICAL
    turns = [rotation_pan_from_camera(rig.mount(left)).T @ pan_from_ideal for left in (True, False)]
    return EyeImage(cameras[0], ideal, turns[0]), EyeImage(cameras[1], ideal, turns[1])
