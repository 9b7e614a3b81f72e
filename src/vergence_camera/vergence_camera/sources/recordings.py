"""Recordings on disk: an AVI of JPEGs, any video file that OpenCV's decoders read, a folder of pictures."""

import re
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from vergence_camera.errors import CorruptFrameError, FileMissingError, TruncatedFileError, UnsupportedError
from vergence_camera.frame import Mode
from vergence_camera.jpeg import JPEG_START, inspect_jpeg
from vergence_camera.sources.avi_demuxer import frames, is_avi, read_header
from vergence_camera.sources.replay import Picture, Recording
from vergence_camera.sources.requested_mode import mode_of
from vergence_rig.picture_file import check_size, decode_picture
from vergence_rig.regular_file import FileError, check_regular_file, read_regular_file

PICTURE_SUFFIXES = {".jpg", ".jpeg", ".png", ".bmp", ".tif", ".tiff", ".webp", ".pgm", ".ppm"}


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

    def pictures(self) -> Iterator[bytes]:
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
    """A folder of pictures, in natural order of their names; JPEGs pass through untouched.

    Hidden files, folders, pipes and devices are not looked at. EXIF orientation is ignored: pictures are as the sensor
    took them, which is what a calibration is of.
    """

    def __init__(self, path: Path) -> None:
        self._path = path

    @property
    def identity(self) -> str:
        """See Recording."""
        return str(self._path)

    def mode(self) -> Mode:
        """See Recording. It is that of the first picture that can be used."""
        reasons = []
        for file in self._files():
            picture = self._load(file)
            if isinstance(picture, CorruptFrameError):
                reasons.append(str(picture))
            elif isinstance(picture, bytes):
                info = inspect_jpeg(picture, must_be_whole=False)
                return Mode("MJPG", info.width_px, info.height_px, 0.0)
            else:
                return Mode("GREY" if picture.ndim == 2 else "BGR3", picture.shape[1], picture.shape[0], 0.0)
        raise UnsupportedError(f"{self._path}: none of its {len(reasons)} pictures can be used: {reasons[0]}")

    def pictures(self) -> Iterator[Picture]:
        """See Recording."""
        for file in self._files():
            yield self._load(file)

    def _files(self) -> list[Path]:
        try:
            files = [
                file
                for file in self._path.iterdir()
                if file.suffix.lower() in PICTURE_SUFFIXES and not file.name.startswith(".") and file.is_file()
            ]
        except OSError as error:
            raise FileMissingError(f"{self._path}: cannot be read: {error.strerror}") from error
        if not files:
            kinds = ", ".join(sorted(PICTURE_SUFFIXES))
            raise FileMissingError(f"{self._path}: has no pictures in it ({kinds})")
        return sorted(files, key=_natural)

    def _load(self, file: Path) -> Picture:
        try:
            data = read_regular_file(file)
            if not data.startswith(JPEG_START):
                return decode_picture(data, cv2.IMREAD_ANYCOLOR)
            info = inspect_jpeg(data, must_be_whole=False)
            check_size(info.width_px, info.height_px)
            return data
        except FileError as error:
            return CorruptFrameError(f"{file} {error}")
        except CorruptFrameError as error:
            return CorruptFrameError(f"{file}: {error}")


def open_recording(path: Path) -> Recording:
    """Return the recording at `path`; raise FileMissingError if there is none that can be read."""
    if path.is_dir():
        return FolderRecording(path)
    if not path.exists():
        raise FileMissingError(f"{path}: there is no such file")
    try:
        check_regular_file(path)
    except FileError as error:
        raise FileMissingError(f"{path} {error}") from error
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
