"""One eye's view of its photograph: the exact homography of a rotation about the optical centre.

A view shows the photograph where the photograph reaches. Beyond its frame there is nothing true to show: its border
pixels go on, blurred the more the farther they are from it, and fade to its mean colour. So the frame itself makes no
edge; `outside_share` says how much of a view is such padding.
"""

import math
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from vergence_rig.geometry import ROTATION_EYE_FROM_OPTICAL, rotation_rig_from_eye
from vergence_rig.rig import EyeMount
from vergence_sim.optics import Lens

Array = npt.NDArray[np.float64]
Image = npt.NDArray[np.uint8]

_MARGIN_PX = 160
_BLUR_PX = (3.0, 12.0, 40.0)
_PHOTO_FROM_RIG = ROTATION_EYE_FROM_OPTICAL.T


def mount_rotation(mount: EyeMount) -> Array:
    """Return how a camera is turned on its pan axis (3, 3): by roll, pitch, then yaw about the pan frame's axes."""
    cos, sin = math.cos(mount.roll_rad), math.sin(mount.roll_rad)
    roll = np.array([[1.0, 0.0, 0.0], [0.0, cos, -sin], [0.0, sin, cos]])
    return rotation_rig_from_eye(mount.yaw_rad, 0.0) @ rotation_rig_from_eye(0.0, mount.pitch_rad) @ roll


@dataclass(frozen=True)
class Padded:
    """A photograph (h, w, 3) with a margin that makes no edge at its frame, and the colour (3,) beyond the margin."""

    image: Image
    beyond: tuple[float, ...]
    width_px: int
    height_px: int


def padded(photograph: Image) -> Padded:
    """Return a photograph (h, w, 3) BGR with its margin."""
    height, width = photograph.shape[:2]
    mean = photograph.reshape(-1, 3).mean(axis=0)
    grown = cv2.copyMakeBorder(photograph, *(_MARGIN_PX,) * 4, cv2.BORDER_REPLICATE)
    inside = np.zeros(grown.shape[:2], np.uint8)
    inside[_MARGIN_PX:-_MARGIN_PX, _MARGIN_PX:-_MARGIN_PX] = 1
    away = cv2.distanceTransform(1 - inside, cv2.DIST_L2, 5)[:, :, None] / np.float32(_MARGIN_PX)
    faded = grown.astype(np.float32)
    for step, sigma in enumerate(_BLUR_PX):
        share = np.clip((away - 0.02 * step) / (0.06 + 0.1 * step), 0.0, 1.0)
        faded += share * (_blurred(faded, sigma) - faded)
    faded += np.minimum(away, 1.0) ** 2 * (mean.astype(np.float32) - faded)
    image = np.clip(np.rint(faded), 0, 255).astype(np.uint8)
    image[_MARGIN_PX:-_MARGIN_PX, _MARGIN_PX:-_MARGIN_PX] = photograph
    return Padded(image, tuple(mean.tolist()), width, height)


def _blurred(image: npt.NDArray[np.float32], sigma: float) -> npt.NDArray[np.float32]:
    """Return the image blurred by a Gaussian: wide ones at a fraction of the resolution, where they cost little."""
    fraction = max(int(sigma) // 3, 1)
    height, width = image.shape[:2]
    small = cv2.resize(image, (width // fraction, height // fraction), interpolation=cv2.INTER_AREA)
    small = cv2.GaussianBlur(small, (0, 0), sigma / fraction)
    return np.asarray(cv2.resize(small, (width, height), interpolation=cv2.INTER_LINEAR), np.float32)


class PhotoEye:
    """Warps one photograph to what an eye sees of it, and points to where it sees them.

    Args:
        photograph: with its margin.
        matrix: (3, 3) camera matrix of the photograph.
        lens: the eye's camera; it distorts the view.
        mount: (3, 3) rotation of the camera on its pan axis; where its lens is cannot be seen.
    """

    def __init__(self, photograph: Padded, matrix: Array, lens: Lens, mount: Array) -> None:
        self._photograph = photograph
        self._lens, self._mount = lens, mount
        self._matrix = matrix
        shift = np.array([[1.0, 0.0, _MARGIN_PX], [0.0, 1.0, _MARGIN_PX], [0.0, 0.0, 1.0]])
        self._padded_from_rig = shift @ matrix @ _PHOTO_FROM_RIG
        camera = lens.camera
        self._size = camera.width_px, camera.height_px
        focal = lens.render_focal_px
        # The lens takes a pinhole view about the image's own centre, a little wider than the camera's.
        self._rays_of_view = np.linalg.inv(
            np.array([[focal, 0, 0.5 * (camera.width_px - 1)], [0, focal, 0.5 * (camera.height_px - 1)], [0, 0, 1]])
        )

    def view(self, pan_rad: float, tilt_rad: float) -> Image:
        """Return the pinhole view (h, w, 3) at these angles [rad], before the lens distorts it."""
        homography = self._padded_from_rig @ self._rig_from_optical(pan_rad, tilt_rad) @ self._rays_of_view
        return np.asarray(
            cv2.warpPerspective(
                self._photograph.image,
                homography,
                self._size,
                flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
                borderMode=cv2.BORDER_CONSTANT,
                borderValue=self._photograph.beyond,
            ),
            np.uint8,
        )

    def outside_share(self, pan_rad: float, tilt_rad: float) -> float:
        """Return the share of the image at these angles [rad] that lies outside the photograph."""
        across, down = np.meshgrid(np.linspace(0, self._size[0] - 1, 49), np.linspace(0, self._size[1] - 1, 33))
        pixels = np.stack([across.ravel(), down.ravel(), np.ones(across.size)])
        rays = self._rig_from_optical(pan_rad, tilt_rad) @ self._rays_of_view @ pixels
        x, y, depth = self._matrix @ _PHOTO_FROM_RIG @ rays
        x, y = x / depth, y / depth
        inside = (depth > 0) & (x >= 0) & (x <= self._photograph.width_px - 1)
        inside &= (y >= 0) & (y <= self._photograph.height_px - 1)
        return 1.0 - float(inside.mean())

    def project(self, ray: Array, pan_rad: float, tilt_rad: float) -> tuple[float, float]:
        """Return the pixel (x, y), as the lens distorts it, at which a direction (3,) is seen; NaN behind the eye."""
        x, y, depth = (self._rig_from_optical(pan_rad, tilt_rad).T @ ray).tolist()
        if depth <= 1e-9:
            return math.nan, math.nan
        camera = self._lens.camera
        ideal = camera.fx_px * x / depth + camera.cx_px, camera.fy_px * y / depth + camera.cy_px
        return self._lens.distorted(ideal)

    def axis(self, pan_rad: float, tilt_rad: float) -> Array:
        """Return the unit axis (3,) of the camera itself, that of its principal point, at its axes' angles [rad]."""
        return np.asarray((rotation_rig_from_eye(pan_rad, tilt_rad) @ self._mount)[:, 0])

    def _rig_from_optical(self, pan_rad: float, tilt_rad: float) -> Array:
        return rotation_rig_from_eye(pan_rad, tilt_rad) @ self._mount @ ROTATION_EYE_FROM_OPTICAL
