"""The detector of faces, which is not shipped: its file, where it is from, and how it is checked."""

import hashlib
from pathlib import Path

from vergence_rig.regular_file import read_regular_file

FACE_CLASS = "face"
"""The class of a goal that looks at a face."""

FACE_MODEL = "face_detection_yunet_2023mar.onnx"
"""YuNet of the OpenCV Zoo, models/face_detection_yunet, MIT licence."""

FACE_MODEL_BYTES = 232_589
FACE_MODEL_SHA256 = "8f2383e4dd3cfbb4553ea8718107fc0423210dc964f9f4280604804ed2552fa4"

FACE_HINT = (
    f"faces need YuNet: the file {FACE_MODEL} of the OpenCV Zoo as detector.model of box_metric_node "
    "(docs/detector.md, Faces)"
)
"""What is missing where a face is asked for and the detector has no such class."""


def is_face_model(path: str | Path) -> bool:
    """Return whether a file is FACE_MODEL, by its SHA-256. Raises FileError where it cannot be read."""
    return hashlib.sha256(read_regular_file(path)).hexdigest() == FACE_MODEL_SHA256
