"""From the text that chooses a camera to the source that reads it. `register_url_scheme` adds a kind of source."""

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import unquote, urlsplit

from vergence_camera.devices import PinnedChoice, SystemTree
from vergence_camera.errors import ChoiceError
from vergence_camera.frame import FrameSource, ModeRequest
from vergence_camera.sources.decoded_stream import DecodedStreamSource
from vergence_camera.sources.http_client import shown_url
from vergence_camera.sources.http_mjpeg import HttpMjpegSource
from vergence_camera.sources.recordings import open_recording
from vergence_camera.sources.replay import Replay
from vergence_camera.v4l2.capture import DeviceUser, V4l2Source
from vergence_camera.v4l2.kernel import Kernel, LinuxKernel
from vergence_rig.regular_file import expanded

_VIDEO_SUFFIXES = (".avi", ".mp4", ".mkv", ".mov", ".m4v", ".webm", ".ts", ".mpg", ".h264", ".264", ".m3u8", ".mjpg")


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


UrlBuilder = Callable[[str, SourceOptions], FrameSource]
"""Returns the source of a URL, not opened yet."""

_URL_BUILDERS: dict[str, UrlBuilder] = {}


def register_url_scheme(scheme: str, build: UrlBuilder) -> None:
    """Let `device` be a URL of another scheme; raises ValueError for one in use."""
    if scheme in _URL_BUILDERS:
        raise ValueError(f"the URL scheme of a camera source must be new: got {scheme!r}, which is registered")
    _URL_BUILDERS[scheme] = build


def allowed_devices() -> str:
    """Return what a camera's choice must be, for messages."""
    return f"a camera, a video file, a folder of pictures or a URL ({', '.join(_URL_BUILDERS)})"


def shown_choice(text: str) -> str:
    """Return a camera's choice as it may stand in logs and diagnostics: a URL without passwords."""
    return shown_url(text) if "://" in text else text


def check_choice(text: str) -> None:
    """Raise ChoiceError if `text` can name no camera, file or URL; whether it is there is not checked."""
    if not text.strip():
        raise ChoiceError(f"device must be {allowed_devices()}: got an empty text")
    scheme = _scheme(text)
    if scheme and scheme not in _URL_BUILDERS:
        raise ChoiceError(f"device must be {allowed_devices()}: got '{text}', whose scheme is '{scheme}'")


def make_source(
    text: str,
    options: SourceOptions,
    *,
    kernel: Kernel | None = None,
    tree: SystemTree | None = None,
    user: DeviceUser | None = None,
) -> FrameSource:
    """Return the source that `text` names, not opened yet; raise CameraError if it can be none.

    `kernel` and `tree` replace the machine's own in tests; `user` is called when a device opens and closes.
    """
    check_choice(text)
    scheme = _scheme(text)
    if scheme:
        return _URL_BUILDERS[scheme](text, options)
    if _is_recording(text):
        return _recording(Path(text), options)
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


def _scheme(text: str) -> str:
    scheme, separator, _ = text.partition("://")
    return scheme.lower() if separator else ""


def _is_recording(text: str) -> bool:
    if text.startswith("/dev/") or re.fullmatch(r"(serial|port|number):.*|\d{1,3}", text):
        return False
    path = expanded(text)
    return path.exists() or "/" in text or path.suffix.lower() in _VIDEO_SUFFIXES


def _recording(path: Path, options: SourceOptions) -> FrameSource:
    return Replay(
        open_recording(expanded(path)),
        options.request,
        rate_hz=options.replay_rate_hz,
        loop=options.replay_loop,
        must_be_whole=options.drop_corrupt,
    )


def _file_url(url: str, options: SourceOptions) -> FrameSource:
    return _recording(Path(unquote(urlsplit(url).path)), options)


def _http_url(url: str, options: SourceOptions) -> FrameSource:
    if urlsplit(url).path.lower().endswith(_VIDEO_SUFFIXES) and not url.lower().endswith(".mjpg"):
        return _decoded_stream(url, options)
    return HttpMjpegSource(
        url, options.request, open_timeout_s=options.open_timeout_s, must_be_whole=options.drop_corrupt
    )


def _decoded_stream(url: str, options: SourceOptions) -> FrameSource:
    return DecodedStreamSource(
        url, options.request, open_timeout_s=options.open_timeout_s, stall_timeout_s=options.stall_timeout_s
    )


register_url_scheme("file", _file_url)
for _scheme_name in ("http", "https"):
    register_url_scheme(_scheme_name, _http_url)
for _scheme_name in ("rtsp", "rtsps", "rtmp", "udp", "tcp", "srt"):
    register_url_scheme(_scheme_name, _decoded_stream)
