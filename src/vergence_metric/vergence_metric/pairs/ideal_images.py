"""Both eyes' images as ideal cameras would take them (see `vergence_rig.eye_image`), drawn only where they differ."""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from vergence_rig.camera import CameraModel
from vergence_rig.eye_image import EyeImage, described_camera, eye_images
from vergence_rig.rig import Rig

Pixels = npt.NDArray[np.uint8]
Models = tuple[CameraModel, CameraModel]


@dataclass(frozen=True)
class _Eye:
    image: EyeImage
    maps: tuple[Any, Any] | None = None
    seen_px: int | None = None

    def draw(self, pixels: Pixels) -> Pixels:
        """Return the ideal image; what lies outside the camera's repeats its border."""
        if self.maps is None:
            return pixels
        return np.asarray(cv2.remap(pixels, *self.maps, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), np.uint8)


class IdealImages:
    """Draws the ideal images of pairs; keeps the maps while the cameras stay the same.

    An eye without a calibration has the camera that the rig describes, if its images have that shape.
    """

    def __init__(self, rig: Rig) -> None:
        self._rig = rig
        self._cameras: Models | None = None
        self._eyes: tuple[_Eye, _Eye] | None = None

    def describes(self, left: bool, width_px: int, height_px: int) -> bool:
        """Return whether the rig describes one eye's camera for images of this shape."""
        return described_camera(self._rig.camera(left), width_px, height_px) is not None

    def cameras(self, calibrated: tuple[CameraModel | None, CameraModel | None], pair: tuple[Pixels, Pixels]) -> Models:
        """Return both cameras for a pair of these sizes; raises ValueError where one has none."""
        found = []
        for left, camera, pixels in zip((True, False), calibrated, pair, strict=True):
            height, width = pixels.shape[:2]
            if camera is None or (camera.width_px, camera.height_px) != (width, height):
                camera = described_camera(self._rig.camera(left), width, height)
            if camera is None:
                eye = "left" if left else "right"
                raise ValueError(f"no calibration of the {eye} camera for {width}x{height} images")
            found.append(camera)
        return found[0], found[1]

    def set_cameras(self, cameras: Models) -> tuple[EyeImage, EyeImage]:
        """Use these cameras from now on; returns how their images map to the ideal ones."""
        if self._eyes is None or self._cameras is None or not _same(cameras, self._cameras):
            self._cameras = cameras
            left, right = eye_images(self._rig, cameras)
            self._eyes = _eye(left), _eye(right)
        return self._eyes[0].image, self._eyes[1].image

    @property
    def seen_px(self) -> int | None:
        """Side of the largest square about the middle that both cameras see [px]; None where they see all."""
        return min((eye.seen_px for eye in self._eyes or () if eye.seen_px is not None), default=None)

    def draw(self, left: Pixels, right: Pixels) -> tuple[Pixels, Pixels]:
        """Return the ideal images of a pair that the cameras in use took, (h, w) or (h, w, 3) each."""
        if self._eyes is None:
            raise RuntimeError("cameras must be set before images are drawn")
        return self._eyes[0].draw(left), self._eyes[1].draw(right)


def _same(cameras: Models, others: Models) -> bool:
    return all(one is other or one.equals(other) for one, other in zip(cameras, others, strict=True))


def _eye(image: EyeImage) -> _Eye:
    """Return an eye with the maps of cv2.remap, where the camera's image is not the ideal one already."""
    if image.is_same:
        return _Eye(image)
    x, y = image.maps()
    camera = image.camera
    unseen = (x < 0) | (x > camera.width_px - 1) | (y < 0) | (y > camera.height_px - 1)
    # In a square of side s about pixel n // 2 lie the pixels from n // 2 - s // 2 on, s of them.
    down, across = (np.abs(2 * np.arange(n) - 2 * (n // 2) + 0.5) for n in unseen.shape)
    nearest = np.maximum.outer(down, across)[unseen].min(initial=np.inf)
    fixed, fractions = cv2.convertMaps(x, y, cv2.CV_16SC2)
    return _Eye(image, (fixed, fractions), None if np.isinf(nearest) else int(nearest))
