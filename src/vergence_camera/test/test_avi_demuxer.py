"""The demuxer's bytes are the file's bytes, independent of the writer, and a truncated file is reported."""

import io
import struct
from pathlib import Path

import cv2
import numpy as np
import pytest

from vergence_camera.errors import TruncatedFileError, UnsupportedError
from vergence_camera.sources.avi_demuxer import frames, is_avi, read_header


def decoded_by_opencv(path: Path) -> list[np.ndarray]:
    capture = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
    pictures = []
    while (result := capture.read())[0]:
        pictures.append(result[1])
    capture.release()
    return pictures


@pytest.mark.parametrize("backend", [cv2.CAP_OPENCV_MJPEG, cv2.CAP_FFMPEG])
def test_yields_the_jpegs_that_a_decoder_sees(tmp_path: Path, backend: int) -> None:
    path = tmp_path / "a.avi"
    writer = cv2.VideoWriter(str(path), backend, cv2.VideoWriter.fourcc(*"MJPG"), 30.0, (320, 240))
    for number in range(7):
        writer.write(np.full((240, 320, 3), 30 * number, np.uint8))
    writer.release()
    assert is_avi(path)
    with path.open("rb") as file:
        header = read_header(file, "a.avi")
        ours = list(frames(file, header, "a.avi"))
    assert (header.width_px, header.height_px, header.is_mjpeg) == (320, 240, True)
    assert header.rate_hz == pytest.approx(30.0)
    theirs = decoded_by_opencv(path)
    assert len(ours) == len(theirs) == 7
    for data, picture in zip(ours, theirs, strict=True):
        own = np.asarray(cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR))
        # Two JPEG decoders: they may round differently.
        assert np.abs(own.astype(int) - picture).max() <= 3


def test_another_codec_is_recognised(tmp_path: Path) -> None:
    path = tmp_path / "xvid.avi"
    writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*"XVID"), 20.0, (320, 240))
    writer.write(np.zeros((240, 320, 3), np.uint8))
    writer.release()
    with path.open("rb") as file:
        header = read_header(file, "xvid.avi")
    assert header.code in (b"XVID", b"FMP4")  # releases of ffmpeg differ
    assert not header.is_mjpeg


def test_a_file_cut_in_the_middle_gives_its_whole_frames_first(mjpeg_avi: Path) -> None:
    whole = mjpeg_avi.read_bytes()
    with mjpeg_avi.open("rb") as file:
        all_frames = list(frames(file, read_header(file, "a"), "a"))
    # Into the sixth frame's data.
    cut = whole.index(all_frames[5]) + len(all_frames[5]) // 2
    broken = io.BytesIO(whole[:cut])
    found = frames(broken, read_header(broken, "a"), "a")
    assert [next(found) for _ in range(5)] == all_frames[:5]
    with pytest.raises(TruncatedFileError, match="before its last frame"):
        next(found)


def test_cut_inside_the_header(mjpeg_avi: Path) -> None:
    broken = io.BytesIO(mjpeg_avi.read_bytes()[:100])
    with pytest.raises((TruncatedFileError, UnsupportedError)):
        read_header(broken, "a")


def test_something_else_is_refused() -> None:
    with pytest.raises(UnsupportedError, match="is not an AVI"):
        read_header(io.BytesIO(b"RIFF\x00\x00\x00\x00WAVEfmt "), "a.wav")


def chunk(tag: bytes, data: bytes) -> bytes:
    return tag + struct.pack("<I", len(data)) + data + b"\0" * (len(data) & 1)


def riff(kind: bytes, data: bytes) -> bytes:
    return b"RIFF" + struct.pack("<I", len(data) + 4) + kind + data


def test_open_dml_sound_and_repeated_frames() -> None:
    """Longer files are several RIFFs; sound chunks and empty frames lie between the pictures."""
    video = struct.pack("<4s4sIHHIIIIIIII", b"vids", b"MJPG", 0, 0, 0, 0, 1, 15, 0, 0, 0, 0, 0)
    sound = struct.pack("<4s4sIHHIIIIIIII", b"auds", b"\0\0\0\0", 0, 0, 0, 0, 1, 8000, 0, 0, 0, 0, 0)
    form = struct.pack("<IiiHH4sIiiII", 40, 64, -48, 1, 24, b"MJPG", 0, 0, 0, 0, 0)
    streams = chunk(b"LIST", b"strl" + chunk(b"strh", sound) + chunk(b"strf", bytes(18)))
    streams += chunk(b"LIST", b"strl" + chunk(b"strh", video) + chunk(b"strf", form))
    header = chunk(b"LIST", b"hdrl" + chunk(b"avih", bytes(56)) + streams)
    first = chunk(b"01dc", b"one") + chunk(b"00wb", b"noise") + chunk(b"01dc", b"")
    second = chunk(b"LIST", b"rec " + chunk(b"01dc", b"three"))
    data = riff(b"AVI ", header + chunk(b"LIST", b"movi" + first) + chunk(b"idx1", bytes(16)))
    data += riff(b"AVIX", chunk(b"LIST", b"movi" + second))
    file = io.BytesIO(data)
    found = read_header(file, "x")
    assert (found.stream, found.width_px, found.height_px, found.rate_hz) == (1, 64, 48, 15.0)
    assert list(frames(file, found, "x")) == [b"one", b"three"]
