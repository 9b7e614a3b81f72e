"""A cheap webcam's imperfections: motion blur, lens distortion, exposure, white balance, noise, JPEG."""

import math
from collections.abc import Iterator
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from vergence_rig.rig import CameraSpec
from vergence_sim.camera_parameters import RightCameraParameters
from vergence_sim.memory import return_free_memory
from vergence_sim.parameters import SimParameters

Image = npt.NDArray[np.uint8]

_NOISE_BANK = 8


_LEAST_BLUR_PX = 2.0


def motion_blurred(view: Image, motion_px: tuple[float, float]) -> Image:
    """Return a view (h, w, 3) that moved by `motion_px` (x, y) while it was exposed.

    The whole view moves alike, as it does when the eye turns, so that a pursued target is blurred too. Motions of less
    than two pixels change nothing.
    """
    width, height = (round(abs(value)) for value in motion_px)
    if max(width, height) < _LEAST_BLUR_PX:
        return view
    return np.asarray(cv2.blur(view, (max(width, 1), max(height, 1)), borderType=cv2.BORDER_REPLICATE), np.uint8)


class Lens:
    """Maps a rendered pinhole view, a little wider than the camera's, to the distorted image.

    `render_focal_px` is the focal length to render with, small enough that the view covers the corners of the image.
    """

    def __init__(self, camera: CameraSpec) -> None:
        self.camera = camera
        self._distortion = np.array(camera.distortion)
        self._matrix = np.array([[camera.fx_px, 0, camera.cx_px], [0, camera.fy_px, camera.cy_px], [0, 0, 1]])
        self.render_focal_px = camera.fx_px
        centre = np.array([(camera.width_px - 1) / 2, (camera.height_px - 1) / 2])
        centred = bool((centre == (camera.cx_px, camera.cy_px)).all()) and camera.fx_px == camera.fy_px
        self._maps: tuple[Any, Any] | None = None
        if not any(camera.distortion) and centred:
            return
        x, y = np.meshgrid(np.arange(camera.width_px, dtype=np.float64), np.arange(camera.height_px, dtype=np.float64))
        pixels = np.stack([x.ravel(), y.ravel()], axis=1)[:, None, :]
        rays = cv2.undistortPoints(pixels, self._matrix, self._distortion)
        rays = rays.reshape(camera.height_px, camera.width_px, 2)
        self.render_focal_px = float(min(camera.fx_px, *(centre / np.abs(rays).max(axis=(0, 1)))))
        x, y = np.moveaxis((rays * self.render_focal_px + centre).astype(np.float32), 2, 0)
        self._maps = np.ascontiguousarray(x), np.ascontiguousarray(y)

    def apply(self, view: Image) -> Image:
        """Return the distorted image (h, w, 3) BGR of a view, (h, w, 3) BGR or (h, w, 4) RGBA."""
        if self._maps is None and view.shape[2] == 3:
            return view
        if self._maps is not None:
            # OpenCV takes more than twice as long for three channels.
            rgba = cv2.cvtColor(view, cv2.COLOR_BGR2RGBA) if view.shape[2] == 3 else view
            view = np.asarray(cv2.remap(rgba, *self._maps, cv2.INTER_LINEAR), np.uint8)
        return np.asarray(cv2.cvtColor(view, cv2.COLOR_RGBA2BGR), np.uint8)

    def distorted(self, pixel: tuple[float, float]) -> tuple[float, float]:
        """Return the distorted pixel (x, y) of an undistorted one; NaN stays NaN."""
        if math.isnan(pixel[0]):
            return pixel
        ((x, y),) = self.distorted_points(np.array([pixel])).tolist()
        return x, y

    def distorted_points(self, points_px: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Return the distorted pixels (N, 2) of finite undistorted ones (N, 2)."""
        if not self._distortion.any():
            return points_px
        camera = self.camera
        centre, focal = np.array([camera.cx_px, camera.cy_px]), np.array([camera.fx_px, camera.fy_px])
        rays = np.column_stack([(points_px - centre) / focal, np.ones(len(points_px))])
        placed, _ = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), self._matrix, self._distortion)
        return np.asarray(placed, np.float64).reshape(-1, 2)


class Sensor:
    """Exposure, white balance, noise and JPEG of one eye. Deterministic for a generator of one seed."""

    def __init__(self, rng: np.random.Generator, shape: tuple[int, int], right: bool) -> None:
        self._rng = rng
        self._right = right
        self._shape = shape
        self._before_noise = rng.bit_generator.state
        for _ in _fields(rng, shape):
            pass  # the generator goes on as if the fields were kept, which would take a hundred megabytes
        self._noise: list[npt.NDArray[np.int8]] = []
        self._noise_sigma = -1.0

    def apply(self, image: Image, parameters: SimParameters) -> Image:
        """Return the sensor's output for an image (h, w, 3) BGR."""
        if self._right:
            image = self._exposed(image, parameters.right_camera)
        camera = parameters.camera
        if camera.noise_sigma > 0:
            image = self._noisy(image, camera.noise_sigma)
        if camera.jpeg_quality > 0:
            _, jpeg = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, camera.jpeg_quality])
            image = np.asarray(cv2.imdecode(jpeg, cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION), np.uint8)
        return image

    def _exposed(self, image: Image, camera: RightCameraParameters) -> Image:
        gains = (camera.gain * camera.blue_gain, camera.gain, camera.gain * camera.red_gain)
        if gains == (1.0, 1.0, 1.0):
            return image
        return np.asarray(cv2.transform(image, np.diag(gains)), np.uint8)

    def _noisy(self, image: Image, sigma: float) -> Image:
        if sigma != self._noise_sigma:
            again = np.random.default_rng()
            again.bit_generator.state = self._before_noise
            self._noise = [_levels(field * sigma) for field in _fields(again, self._shape)]
            self._noise_sigma = sigma
            return_free_memory()
        # A new field for every frame would cost more than rendering: take a random one at a random shift.
        noise = self._noise[int(self._rng.integers(_NOISE_BANK))]
        row = int(self._rng.integers(image.shape[0]))
        # As signed bytes about mid-grey, which OpenCV adds, and saturates alike, in a third of the time.
        noisy, first = np.bitwise_xor(image, 0x80), image.shape[0] - row
        shifted = ((slice(0, first), slice(row, None)), (slice(first, None), slice(0, row)))
        for there, taken in shifted[: 1 + (row > 0)]:
            part = noisy[there].view(np.int8)
            cv2.add(part, noise[taken], dst=part)
        return np.bitwise_xor(noisy, 0x80, out=noisy)


def _fields(rng: np.random.Generator, shape: tuple[int, int]) -> Iterator[npt.NDArray[np.float32]]:
    """Yield the fields of noise of deviation 1, one at a time."""
    for _ in range(_NOISE_BANK):
        yield rng.standard_normal((*shape, 3), dtype=np.float32)


def _levels(noise: npt.NDArray[np.float32]) -> npt.NDArray[np.int8]:
    """Return a noise in whole grey levels, at most 127."""
    return np.clip(np.rint(noise), -127, 127).astype(np.int8)
