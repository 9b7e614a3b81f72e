"""Recordings on disk: an AVI of JPEGs, any video file that OpenCV's decoders read, a folder of pictures."""

import re
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from vergence_camera.errors import CorruptFrameError, FileMissingError, TruncatedFileError, UnsupportedError
from vergence_camera.frame import Mode, Pixels
from vergence_camera.jpeg import inspect_jpeg
from vergence_camera.sources.avi_demuxer import frames, is_avi, read_header
from vergence_camera.sources.replay import Picture, Recording
from vergence_camera.sources.requested_mode import mode_of

PICTURE_SUFFIXES = {".jpg", ".jpeg", ".png", ".bmp", ".tif", ".tiff", ".webp", ".pgm", ".ppm"}
_JPEG_SUFFIXES = {".jpg", ".jpeg"}


class AviRecording:
    """Motion JPEG in an AVI: its bytes pass through untouched."""

    def __init__(self, path: Path) -> None:
        self._path = path

    @property
    def identity(self) -> str:
        """See Recording."""
        return str(self._path)

    def mode(self) -> Mode:
        """See Recording."""
        with self._path.open("rb") as file:
            header = read_header(file, self.identity)
        return Mode("MJPG", header.width_px, header.height_px, header.rate_hz)

    def pictures(self) -> Iterator[Picture]:
        """See Recording."""
        with self._path.open("rb", buffering=0) as file:  # the demuxer reads only what it needs
            header = read_header(file, self.identity)
            yield from frames(file, header, self.identity)


class VideoRecording:
    """Any video file, decoded by OpenCV's bundled ffmpeg (H.264, MPEG-4, VP9, ...)."""

    def __init__(self, path: Path) -> None:
        self._path = path

    @property
    def identity(self) -> str:
        """See Recording."""
        return str(self._path)

    def mode(self) -> Mode:
        """See Recording."""
        capture = self._open()
        try:
            return mode_of(capture)
        finally:
            capture.release()

    def pictures(self) -> Iterator[Picture]:
        """See Recording. A file that claims more frames than can be decoded is reported as truncated."""
        capture = self._open()
        try:
            promised, given = int(capture.get(cv2.CAP_PROP_FRAME_COUNT)), 0
            while True:
                done, pixels = capture.read()
                if not done:
                    break
                given += 1
                yield np.asarray(pixels, dtype=np.uint8)
        finally:
            capture.release()
        # Containers round their durations: a frame or two short is no damage.
        if promised - given > max(2, promised // 50):
            raise TruncatedFileError(f"{self._path}: {given} of {promised} frames can be decoded")

    def _open(self) -> cv2.VideoCapture:
        capture = cv2.VideoCapture(str(self._path), cv2.CAP_FFMPEG)
        if not capture.isOpened():
            capture.release()
            raise UnsupportedError(f"{self._path}: is no video that can be decoded here")
        return capture


class FolderRecording:
    """A folder of pictures, in natural order of their names; JPEGs pass through untouched."""

    def __init__(self, path: Path) -> None:
        self._path = path

    @property
    def identity(self) -> str:
        """See Recording."""
        return str(self._path)

    def mode(self) -> Mode:
        """See Recording."""
        first = self._load(self._files()[0])
        if isinstance(first, bytes):
            info = inspect_jpeg(first)
            return Mode("MJPG", info.width_px, info.height_px, 0.0)
        return Mode("GREY" if first.ndim == 2 else "BGR3", first.shape[1], first.shape[0], 0.0)

    def pictures(self) -> Iterator[Picture]:
        """See Recording."""
        for file in self._files():
            yield self._load(file)

    def _files(self) -> list[Path]:
        files = [file for file in self._path.iterdir() if file.suffix.lower() in PICTURE_SUFFIXES]
        if not files:
            kinds = ", ".join(sorted(PICTURE_SUFFIXES))
            raise FileMissingError(f"{self._path}: has no pictures in it ({kinds})")
        return sorted(files, key=_natural)

    def _load(self, file: Path) -> Picture:
        data = file.read_bytes()
        if file.suffix.lower() in _JPEG_SUFFIXES:
            return data
        pixels: Pixels | None = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_ANYCOLOR) if data else None
        if pixels is None:
            raise CorruptFrameError(f"{file}: cannot be decoded")
        return pixels


def open_recording(path: Path) -> Recording:
    """Return the recording at `path`; raise FileMissingError if there is none."""
    if path.is_dir():
        return FolderRecording(path)
    if not path.is_file():
        raise FileMissingError(f"{path}: there is no such file")
    if path.suffix.lower() in PICTURE_SUFFIXES:
        raise UnsupportedError(f"{path}: is one picture; give its folder")
    if is_avi(path):
        with path.open("rb") as file:
            if read_header(file, str(path)).is_mjpeg:
                return AviRecording(path)
    return VideoRecording(path)


def _natural(file: Path) -> list[tuple[int, str]]:
    """Order img2 before img10."""
    parts = re.split(r"(\d+)", file.name)
    return [(int(part), "") if part.isdigit() else (-1, part) for part in parts]
