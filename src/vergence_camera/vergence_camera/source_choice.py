"""From the text that chooses a camera to the source that reads it."""

import re
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from urllib.parse import unquote, urlsplit

from vergence_camera.devices import PinnedChoice, SystemTree
from vergence_camera.errors import ChoiceError
from vergence_camera.frame import FrameSource, ModeRequest
from vergence_camera.sources.decoded_stream import DecodedStreamSource
from vergence_camera.sources.http_mjpeg import HttpMjpegSource
from vergence_camera.sources.recordings import open_recording
from vergence_camera.sources.replay import Replay
from vergence_camera.v4l2.capture import DeviceUser, V4l2Source
from vergence_camera.v4l2.kernel import Kernel, LinuxKernel

_VIDEO_SUFFIXES = (".avi", ".mp4", ".mkv", ".mov", ".m4v", ".webm", ".ts", ".mpg", ".h264", ".264", ".m3u8", ".mjpg")
_STREAM_SCHEMES = ("rtsp", "rtsps", "rtmp", "udp", "tcp", "srt")
ALLOWED_DEVICES = "a camera, a video file, a folder of pictures or a URL (file, http, https, {} or {})".format(
    ", ".join(_STREAM_SCHEMES[:-1]), _STREAM_SCHEMES[-1]
)
"""What a camera's choice must be, for messages."""


class Kind(Enum):
    """What a choice names."""

    DEVICE = "camera"
    RECORDING = "recording"
    HTTP_JPEG = "HTTP stream of JPEGs"
    DECODED_STREAM = "network stream"


def kind_of(text: str) -> Kind:
    """Return what `text` names, without looking whether it is there; raise ChoiceError if it can be nothing."""
    if not text.strip():
        raise ChoiceError(f"device must be {ALLOWED_DEVICES}: got an empty text")
    scheme, separator, _ = text.partition("://")
    if separator:
        return _kind_of_url(text, scheme.lower())
    if text.startswith("/dev/") or re.fullmatch(r"(serial|port|number):.*|\d{1,3}", text):
        return Kind.DEVICE
    path = Path(text).expanduser()
    if path.exists() or "/" in text or path.suffix.lower() in _VIDEO_SUFFIXES:
        return Kind.RECORDING
    return Kind.DEVICE


def _kind_of_url(text: str, scheme: str) -> Kind:
    if scheme == "file":
        return Kind.RECORDING
    if scheme in ("http", "https"):
        is_video = urlsplit(text).path.lower().endswith(_VIDEO_SUFFIXES) and not text.lower().endswith(".mjpg")
        return Kind.DECODED_STREAM if is_video else Kind.HTTP_JPEG
    if scheme in _STREAM_SCHEMES:
        return Kind.DECODED_STREAM
    raise ChoiceError(f"device must be {ALLOWED_DEVICES}: got '{text}', whose scheme is '{scheme}'")


@dataclass(frozen=True)
class SourceOptions:
    """How the chosen source is to be read; see the parameters of the same names."""

    request: ModeRequest = field(default_factory=ModeRequest)
    replay_rate_hz: float = 0.0
    replay_loop: bool = True
    open_timeout_s: float = 5.0
    stall_timeout_s: float = 1.0
    drop_corrupt: bool = True
    buffers: int = 4


def make_source(
    text: str,
    options: SourceOptions,
    *,
    kernel: Kernel | None = None,
    tree: SystemTree | None = None,
    user: DeviceUser | None = None,
) -> FrameSource:
    """Return the source that `text` names, not opened yet; raise CameraError if it can be none.

    `kernel` and `tree` replace the machine's own in tests; `user` is told when a device opens and closes.
    """
    kind = kind_of(text)
    if kind is Kind.RECORDING:
        path = Path(unquote(urlsplit(text).path) if "://" in text else text).expanduser()
        return Replay(open_recording(path), options.request, rate_hz=options.replay_rate_hz, loop=options.replay_loop)
    if kind is Kind.HTTP_JPEG:
        return HttpMjpegSource(
            text, options.request, open_timeout_s=options.open_timeout_s, must_be_whole=options.drop_corrupt
        )
    if kind is Kind.DECODED_STREAM:
        return DecodedStreamSource(
            text,
            options.request,
            open_timeout_s=options.open_timeout_s,
            stall_timeout_s=options.stall_timeout_s,
        )
    pinned = PinnedChoice(text, tree or SystemTree())
    return V4l2Source(
        kernel or LinuxKernel(),
        pinned.resolve,
        f"camera '{text}'",
        options.request,
        buffers=options.buffers,
        must_be_whole=options.drop_corrupt,
        user=user,
    )
