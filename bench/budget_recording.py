"""Two folders of JPEG pictures, what verged eyes see of photographs at 640x480, for camera_nodes to replay.

Beside them lies the calibration of each camera.
"""

from pathlib import Path

import cv2

from bench.cost_photographs import glances, models
from vergence_rig.camera import CameraModel

RATE_HZ = 30
_PAIRS = 30
_WEBCAM_QUALITY = 90


def record(folder: Path) -> dict[str, Path]:
    """Write the pictures and return the folder of each eye; raises NoPhotographsError where there are none."""
    glance = glances(1, _PAIRS)[0]
    folders = {eye: folder / eye for eye in ("left", "right")}
    for path in folders.values():
        path.mkdir(parents=True, exist_ok=True)
    for number, pair in enumerate(glance.pairs):
        for path, image in zip(folders.values(), pair, strict=True):
            cv2.imwrite(str(path / f"{number:03}.jpg"), image, [cv2.IMWRITE_JPEG_QUALITY, _WEBCAM_QUALITY])
    for eye, camera in zip(folders, models(), strict=True):
        calibration_of(folder / eye).write_text(_calibration(eye, camera), encoding="utf-8")
    return folders


def calibration_of(pictures: Path) -> Path:
    """Return the path of the calibration of the camera that took a folder of pictures."""
    return pictures.with_suffix(".yaml")


def _calibration(eye: str, camera: CameraModel) -> str:
    fx, fy, cx, cy = camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px
    distortion = [float(value) for value in camera.distortion]
    return f"""image_width: {camera.width_px}
image_height: {camera.height_px}
camera_name: {eye}
camera_matrix: {{rows: 3, cols: 3, data: [{fx}, 0.0, {cx}, 0.0, {fy}, {cy}, 0.0, 0.0, 1.0]}}
distortion_model: {camera.distortion_model}
distortion_coefficients: {{rows: 1, cols: {len(distortion)}, data: {distortion}}}
rectification_matrix: {{rows: 3, cols: 3, data: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]}}
projection_matrix: {{rows: 3, cols: 4, data: [{fx}, 0.0, {cx}, 0.0, 0.0, {fy}, {cy}, 0.0, 0.0, 0.0, 1.0, 0.0]}}
"""
