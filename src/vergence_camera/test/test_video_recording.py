"""Videos that are decoded: H.264 made bit by bit, other containers, and one that was cut off."""

from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest

from vergence_camera.errors import ReplayEndedError, TruncatedFileError
from vergence_camera.frame import Encoding, Frame, ModeRequest
from vergence_camera.sources.recordings import VideoRecording, open_recording
from vergence_camera.sources.replay import Replay

Play = Callable[..., Replay]
Take = Callable[[Replay, int], Iterator[Frame]]


class BitWriter:
    """Writes the fields of H.264's syntax."""

    def __init__(self) -> None:
        self.bits: list[int] = []

    def u(self, value: int, length: int) -> "BitWriter":
        self.bits += [value >> shift & 1 for shift in reversed(range(length))]
        return self

    def ue(self, *values: int) -> "BitWriter":
        for value in values:
            self.u(value + 1, 2 * (value + 1).bit_length() - 1)
        return self

    def align(self) -> "BitWriter":
        return self.u(0, -len(self.bits) % 8)

    def raw(self, data: bytes) -> "BitWriter":
        self.bits += np.unpackbits(np.frombuffer(data, np.uint8)).tolist()
        return self

    def nal(self, header: int) -> bytes:
        self.u(1, 1).align()
        body = np.packbits(np.array(self.bits, np.uint8)).tobytes()
        escaped = bytearray()
        zeros = 0
        for byte in body:
            if zeros >= 2 and byte <= 3:
                escaped.append(3)
                zeros = 0
            escaped.append(byte)
            zeros = zeros + 1 if byte == 0 else 0
        return b"\0\0\0\1" + bytes([header]) + bytes(escaped)


def h264(pictures: list[np.ndarray], rate_hz: int) -> bytes:
    """An H.264 stream (ITU-T H.264, baseline) made of PCM macroblocks; each picture is followed by a skipped one."""
    height, width = pictures[0].shape[:2]
    across, down = width // 16, height // 16
    sps = BitWriter().u(66, 8).u(0xC0, 8).u(30, 8).ue(0, 0, 2, 1).u(0, 1).ue(across - 1, down - 1).u(0b1100, 4)
    sps.bits[-1] = 1  # usability information: timing only
    sps.u(0, 4).u(1, 1).u(1, 32).u(2 * rate_hz, 32).u(1, 1).u(0, 4)
    pps = BitWriter().ue(0, 0).u(0, 2).ue(0, 0, 0).u(0, 3).ue(0, 0, 0).u(0b100, 3)
    stream = sps.nal(0x67) + pps.nal(0x68)
    for number, picture in enumerate(pictures):
        planes = cv2.cvtColor(picture, cv2.COLOR_BGR2YUV_I420)
        luma = planes[:height]
        chroma = planes[height:].reshape(2, height // 2, width // 2)
        intra = BitWriter().ue(0, 7, 0).u(0, 4).ue(number % 2).u(0, 2).ue(0, 1)
        for row in range(down):
            for column in range(across):
                block = luma[16 * row : 16 * row + 16, 16 * column : 16 * column + 16].tobytes()
                block += chroma[:, 8 * row : 8 * row + 8, 8 * column : 8 * column + 8].tobytes()
                intra.ue(25).align().raw(block)
        skipped = BitWriter().ue(0, 5, 0).u(1, 4).u(0, 3).ue(0, 1, across * down)
        stream += intra.nal(0x65) + skipped.nal(0x41)
    return stream


@pytest.fixture
def h264_file(tmp_path: Path, make_pixels: Callable[..., np.ndarray]) -> Path:
    path = tmp_path / "clip.h264"
    path.write_bytes(h264([make_pixels(number, 160, 96) for number in range(4)], 25))
    return path


def test_h264_is_decoded(
    h264_file: Path, make_pixels: Callable[..., np.ndarray], replay: Play, frames_of: Take
) -> None:
    source = replay(h264_file, ModeRequest("MJPG", 160, 96), loop=False)
    mode = source.open()
    assert (mode.pixel_format, mode.width_px, mode.height_px, mode.rate_hz) == ("H264", 160, 96, 25.0)
    frames = list(frames_of(source, 8))
    assert all(frame.encoding is Encoding.BGR for frame in frames)
    for number, (intra, skipped) in enumerate(zip(frames[::2], frames[1::2], strict=True)):
        assert np.array_equal(np.asarray(intra.data), np.asarray(skipped.data))
        difference = np.abs(np.asarray(intra.data).astype(int) - make_pixels(number, 160, 96))
        assert difference.mean() < 4.0  # chroma at half the resolution, and YUV's rounding
    with pytest.raises(ReplayEndedError):
        list(frames_of(source, 1))


def test_h264_loops(h264_file: Path, replay: Play, frames_of: Take) -> None:
    source = replay(h264_file)
    source.open()
    frames = list(frames_of(source, 17))
    assert np.array_equal(np.asarray(frames[0].data), np.asarray(frames[16].data))


@pytest.mark.parametrize(("code", "suffix"), [("mp4v", ".mp4"), ("VP80", ".mkv"), ("XVID", ".avi")])
def test_other_containers_are_decoded(
    tmp_path: Path, make_pixels: Callable[..., np.ndarray], code: str, suffix: str, replay: Play, frames_of: Take
) -> None:
    path = tmp_path / f"clip{suffix}"
    writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*code), 20.0, (160, 96))
    if not writer.isOpened():
        pytest.skip(f"this OpenCV cannot write {code}")
    for number in range(6):
        writer.write(make_pixels(number, 160, 96))
    writer.release()
    assert isinstance(open_recording(path), VideoRecording)
    source = replay(path)
    assert source.open().rate_hz == pytest.approx(20.0)
    assert [np.asarray(frame.data).shape for frame in frames_of(source, 6)] == [(96, 160, 3)] * 6


def test_a_truncated_video_is_said(
    tmp_path: Path, make_pixels: Callable[..., np.ndarray], replay: Play, frames_of: Take
) -> None:
    path = tmp_path / "clip.avi"
    writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*"XVID"), 20.0, (160, 96))
    for number in range(40):
        writer.write(make_pixels(number, 160, 96))
    writer.release()
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    source = replay(path, loop=False)
    source.open()
    with pytest.raises(TruncatedFileError, match="of 40 frames"):
        list(frames_of(source, 40))
