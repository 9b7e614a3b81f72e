"""Where the fovea and the metric's windows lie in an eye's raw image."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from vergence_rig.camera import CameraModel
from vergence_rig.eye_image import EyeImage, described_camera, eye_images
from vergence_rig.rig import Rig
from vergence_web.page_state import figure

_CORNERS = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])


class EyeMarks:
    """Marks of both eyes. Cameras are those that rig.yaml describes until camera_info has come."""

    def __init__(self, rig: Rig) -> None:
        self._rig = rig
        self._cameras = [CameraModel(rig.camera(left)) for left in (True, False)]
        self._drawn: tuple[tuple[int, ...], list[dict[str, Any]]] | None = None

    def set_camera(self, left: bool, model: CameraModel | None, width_px: int, height_px: int) -> None:
        """Use an eye's camera by camera_info; None for one without calibration, of which only the size is known."""
        used = model or described_camera(self._rig.camera(left), width_px, height_px)
        if used is not None:
            self._cameras[not left], self._drawn = used, None

    def marks(self, windows_px: Iterable[int]) -> list[dict[str, Any]]:
        """Return for the left and the right eye: size, fovea (x, y), corners of each window, in raw pixels."""
        windows = tuple(windows_px)
        if self._drawn is None or self._drawn[0] != windows:
            left, right = self._cameras
            self._drawn = windows, [_marks(image, windows) for image in eye_images(self._rig, (left, right))]
        return self._drawn[1]


def _marks(image: EyeImage, windows_px: tuple[int, ...]) -> dict[str, Any]:
    middle = np.array([image.ideal.cx_px, image.ideal.cy_px])
    corners = [image.to_camera(middle + size * _CORNERS) for size in windows_px]
    return {
        "size": [image.camera.width_px, image.camera.height_px],
        "fovea": [figure(value, 1) for value in image.to_camera([middle])[0]],
        "windows": [[[figure(value, 1) for value in corner] for corner in window] for window in corners],
    }
