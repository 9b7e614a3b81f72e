"""The rotation of an eye over a recording."""

import math
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from vergence_calibration.eye_turn import Image, NoMotionSeenError, ReferenceImage
from vergence_calibration.identification.axis_log import Frames, IdentifyError
from vergence_rig.camera import CameraModel

Array = npt.NDArray[np.float64]

WIDTH_PX = 320
"""Width of the pictures that a recording of many stores."""
_LEAST_USABLE = 0.7
_LEAST_FRAMES = 8


@dataclass(frozen=True)
class SeenMotion:
    """One eye's rotation since the first frame, (n,) each: stamps and arrivals [s], pan and tilt [rad], agreement.

    NaN for frames in which too few features were found again.
    """

    stamps_s: Array
    arrivals_s: Array
    pan_rad: Array
    tilt_rad: Array
    agreement: Array


def shrunk(picture: Image, width_px: int = WIDTH_PX) -> Image:
    """Return a grey picture (h, w) of this width or less."""
    grey = picture if picture.ndim == 2 else np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY))
    if grey.shape[1] <= width_px:
        return np.ascontiguousarray(grey)
    size = (width_px, round(grey.shape[0] * width_px / grey.shape[1]))
    return np.asarray(cv2.resize(grey, size, interpolation=cv2.INTER_AREA))


def shrunk_camera(camera: CameraModel, picture: Image) -> CameraModel:
    """Return the camera of a picture that was reduced in size. Raises IdentifyError where the shapes differ."""
    height, width = picture.shape[:2]
    x, y = width / camera.width_px, height / camera.height_px
    if abs(x / y - 1.0) > 0.02:
        raise IdentifyError(
            f"no calibration for images of aspect ratio {width}:{height}: camera_info is for {camera.width_px}x"
            f"{camera.height_px} px; calibrate the camera in its running mode"
        )
    middle_x, middle_y = (camera.cx_px + 0.5) * x - 0.5, (camera.cy_px + 0.5) * y - 0.5
    k = [camera.fx_px * x, 0.0, middle_x, 0.0, camera.fy_px * y, middle_y, 0.0, 0.0, 1.0]
    return CameraModel.from_camera_info_values(
        width, height, k, [float(value) for value in camera.distortion], camera.distortion_model
    )


def seen_motion(frames: Frames, camera: CameraModel, where: str) -> SeenMotion:
    """Return how the eye turned.

    Args:
        frames: the recording.
        camera: of the pictures in their original size.
        where: the subject of the error, such as "pan_left, left eye".

    Raises:
        IdentifyError: too few frames, or too few features found again in them.
    """
    count = len(frames.stamps_s)
    if count < _LEAST_FRAMES:
        raise IdentifyError(f"{where}: {_LEAST_FRAMES} or more images must come during the moves: got {count}")
    turns = np.full((count, 3), np.nan)
    try:
        reference = ReferenceImage(frames.pictures[0], shrunk_camera(camera, frames.pictures[0]))
    except NoMotionSeenError as error:
        raise IdentifyError(f"{where}: {error}; point the eye at something with texture") from None
    problem = ""
    for i, picture in enumerate(frames.pictures):
        try:
            turn = reference.turn(picture)
        except NoMotionSeenError as error:
            problem = str(error)
            continue
        turns[i] = turn.pan_rad, turn.tilt_rad, turn.agreement
    usable = float(np.isfinite(turns[:, 0]).mean())
    if usable < _LEAST_USABLE:
        raise IdentifyError(
            f"{where}: motion must be seen in {_LEAST_USABLE:.0%} or more of the images: got {usable:.0%} of {count} "
            f"({problem}; is the light steady, does something hide the view?)"
        )
    return SeenMotion(np.array(frames.stamps_s), np.array(frames.arrivals_s), turns[:, 0], turns[:, 1], turns[:, 2])


def settled(stamps_s: Array, values: Array, commands_s: Array) -> Array:
    """Return the value at the end of every command's rest, (n,): the median of the last three before the next.

    NaN where none came. The last rest ends with the recording.
    """
    found = np.full(len(commands_s), np.nan)
    ends_s = [*commands_s[1:], math.inf]
    known = np.isfinite(values)
    for k, (begin_s, end_s) in enumerate(zip(commands_s, ends_s, strict=True)):
        inside = np.flatnonzero(known & (stamps_s > begin_s) & (stamps_s < end_s))
        if len(inside):
            found[k] = np.median(values[inside[-3:]])
    return found
