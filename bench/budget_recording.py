"""Two folders of JPEG pictures, what verged eyes see of photographs at 640x480, for camera_nodes to replay."""

from pathlib import Path

import cv2

from bench.cost_photographs import glances

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
    return folders
