"""stereo.yaml of a calibration with a board, as a constraint on the mounts.

The board gives the rotation between both cameras at a pose of the joints that the file does not name. Panning turns
both cameras about parallel axes: whatever the pans were, what remains of the rotation are both mounts' rolls and
pitches.
"""

import math
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from vergence_calibration.geometry.bundle import Constraint
from vergence_calibration.geometry.unknowns import index
from vergence_calibration.identification.axis_log import EYES, IdentifyError
from vergence_rig.geometry import ROTATION_EYE_FROM_OPTICAL, rotation_rig_from_eye
from vergence_rig.yaml_file import YamlFileError, read_yaml

Array = npt.NDArray[np.float64]

_SIGMA_RAD = math.radians(0.1)
_ORTHOGONAL = 1e-3


def read_stereo(path: Path) -> Array:
    """Return the rotation (3, 3) of stereo.yaml, x_right = rotation x_left + translation. Raises IdentifyError."""
    try:
        document = read_yaml(path)
        rotation = np.array(document["rotation"]["data"], np.float64).reshape(3, 3)
    except YamlFileError as error:
        raise IdentifyError(f"stereo file '{path}' {error}") from error
    except (KeyError, TypeError, ValueError):
        raise IdentifyError(f"stereo file '{path}' must have rotation.data, nine numbers") from None
    if not (np.abs(rotation @ rotation.T - np.eye(3)).max() < _ORTHOGONAL and np.linalg.det(rotation) > 0):
        raise IdentifyError(f"stereo file '{path}': rotation.data must be a rotation matrix: got {rotation.tolist()}")
    return rotation


def mount_constraint(right_from_left: Array, sigma_rad: float = _SIGMA_RAD) -> Constraint:
    """Return what a rotation (3, 3) between the optical frames says about rolls and pitches."""

    def residuals(vector: Array) -> Array:
        left, right = (_pan_from_camera(vector, eye) for eye in EYES)
        # By the true mounts this is a turn about the pan axes alone.
        turn, _ = cv2.Rodrigues(right @ right_from_left @ left.T)
        return np.asarray(turn, np.float64).ravel()[:2] / sigma_rad

    return Constraint(residuals)


def _pan_from_camera(vector: Array, eye: str) -> Array:
    roll, pitch = vector[index("roll_rad", eye)], vector[index("pitch_rad", eye)]
    rolled = cv2.Rodrigues(np.array([roll, 0.0, 0.0]))[0]
    return np.asarray(rotation_rig_from_eye(0.0, pitch) @ rolled @ ROTATION_EYE_FROM_OPTICAL)
