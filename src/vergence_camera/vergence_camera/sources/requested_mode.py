"""Compares the mode of a recording or stream with the requested one."""

import cv2

from vergence_camera.errors import ModeMismatchError
from vergence_camera.frame import Mode, ModeRequest
from vergence_camera.v4l2.structures import fourcc_text

_HIGHEST_RATE_HZ = 1000.0


def mode_of(capture: cv2.VideoCapture) -> Mode:
    """Return the mode of what OpenCV's ffmpeg has opened; rate 0 where it states none that is plausible."""
    code = fourcc_text(int(capture.get(cv2.CAP_PROP_FOURCC)) & 0xFFFFFFFF).strip("\0").upper()
    width, height = int(capture.get(cv2.CAP_PROP_FRAME_WIDTH)), int(capture.get(cv2.CAP_PROP_FRAME_HEIGHT))
    rate_hz = float(capture.get(cv2.CAP_PROP_FPS))
    return Mode(code or "?", width, height, rate_hz if 0.0 < rate_hz <= _HIGHEST_RATE_HZ else 0.0)


def check_requested(request: ModeRequest, given: Mode, identity: str, kind: str) -> None:
    """Raise ModeMismatchError, naming both, where format or size differ. `kind` is "recording" or so."""
    if request.hard_mismatch(given):
        raise ModeMismatchError(f"{identity}: requested {request}, the {kind} is {given}")


def size_alone(request: ModeRequest) -> ModeRequest:
    """Return the request without format and rate, for a source that is decoded anyway."""
    return ModeRequest("", request.width_px, request.height_px)
