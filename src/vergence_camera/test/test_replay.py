"""Recordings come at their rate, loop or end, and say when they are broken."""

import itertools
import os
import shutil
import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from vergence_camera.errors import (
    CorruptFrameError,
    FileMissingError,
    ModeMismatchError,
    ReplayEndedError,
    TruncatedFileError,
    UnsupportedError,
)
from vergence_camera.frame import Clock, Encoding, Frame, ModeRequest
from vergence_camera.pixels import decode
from vergence_camera.sources.recordings import AviRecording, FolderRecording, open_recording
from vergence_camera.sources.replay import Replay

Play = Callable[..., Replay]
Take = Callable[[Replay, int], Iterator[Frame]]


def test_an_avi_passes_its_bytes_through_at_its_own_rate(mjpeg_avi: Path, replay: Play, frames_of: Take) -> None:
    source = replay(mjpeg_avi)
    assert str(source.open()) == "MJPG 320x240 at 25 Hz"
    content = mjpeg_avi.read_bytes()
    frames = list(frames_of(source, 10))
    assert all(frame.encoding is Encoding.JPEG and frame.clock is Clock.MONOTONIC for frame in frames)
    assert all(isinstance(frame.data, bytes) and frame.data in content for frame in frames)
    assert {b.time_ns - a.time_ns for a, b in itertools.pairwise(frames)} == {40_000_000}


@pytest.mark.parametrize("rate_hz", [5.0, 100.0])
def test_another_rate_may_be_asked_for(mjpeg_avi: Path, rate_hz: float, replay: Play, frames_of: Take) -> None:
    source = replay(mjpeg_avi, rate_hz=rate_hz)
    assert source.open().rate_hz == rate_hz
    frames = list(frames_of(source, 5))
    assert (frames[-1].time_ns - frames[0].time_ns) * 1e-9 == pytest.approx(4.0 / rate_hz)


def test_loops_without_a_break_in_sequence_or_rate(mjpeg_avi: Path, replay: Play, frames_of: Take) -> None:
    source = replay(mjpeg_avi)
    source.open()
    frames = list(frames_of(source, 25))
    assert [frame.sequence for frame in frames] == list(range(25))
    assert frames[0].data == frames[10].data == frames[20].data
    assert {b.time_ns - a.time_ns for a, b in itertools.pairwise(frames)} == {40_000_000}


def test_ends_when_it_is_to_be_played_once(mjpeg_avi: Path, replay: Play, frames_of: Take) -> None:
    source = replay(mjpeg_avi, loop=False)
    source.open()
    assert len(list(frames_of(source, 10))) == 10
    for _ in range(2):
        with pytest.raises(ReplayEndedError):
            list(frames_of(source, 1))


def test_a_long_hold_up_does_not_make_it_race(mjpeg_avi: Path, replay: Play, frames_of: Take, clock: Any) -> None:
    source = replay(mjpeg_avi, catch_up_s=0.25)
    source.open()
    list(frames_of(source, 2))
    clock.sleep(3.0)
    late, following = frames_of(source, 2)
    assert clock.now_ns() - following.time_ns < 1_000_000
    assert following.time_ns - late.time_ns == 40_000_000


def test_reopening_begins_anew(mjpeg_avi: Path, replay: Play, frames_of: Take) -> None:
    source = replay(mjpeg_avi)
    source.open()
    first, *_ = frames_of(source, 4)
    source.open()
    assert next(frames_of(source, 1)).data == first.data
    source.close()
    source.close()


def test_size_mismatch_names_both(mjpeg_avi: Path, replay: Play) -> None:
    with pytest.raises(ModeMismatchError, match=r"640x480.*320x240") as caught:
        replay(mjpeg_avi, ModeRequest("MJPG", 640, 480)).open()
    assert caught.value.permanent


def test_a_truncated_avi_is_said_each_round(mjpeg_avi: Path, replay: Play) -> None:
    content = mjpeg_avi.read_bytes()
    mjpeg_avi.write_bytes(content[: len(content) * 2 // 3])
    source = replay(mjpeg_avi)
    source.open()
    good = faults = 0
    for _ in range(60):
        try:
            good += source.read(0.1) is not None
        except TruncatedFileError:
            faults += 1
    assert faults >= 2
    assert good > 8 * faults / 2


def test_a_folder_in_natural_order_with_jpegs_untouched(
    tmp_path: Path, make_jpeg: Callable[..., bytes], replay: Play, frames_of: Take
) -> None:
    for number in (1, 2, 10):
        (tmp_path / f"img{number}.jpg").write_bytes(make_jpeg(number, 64, 48))
    (tmp_path / "notes.txt").write_text("no picture")
    source = replay(tmp_path)
    mode = source.open()
    assert (mode.pixel_format, mode.rate_hz) == ("MJPG", 30.0)
    assert [frame.data for frame in frames_of(source, 3)] == [make_jpeg(n, 64, 48) for n in (1, 2, 10)]


def test_a_folder_of_png_is_decoded_colour_and_grey(
    tmp_path: Path, make_pixels: Callable[..., np.ndarray], replay: Play, frames_of: Take
) -> None:
    colour = make_pixels(0, 64, 48)
    cv2.imwrite(str(tmp_path / "a.png"), colour)
    cv2.imwrite(str(tmp_path / "b.png"), colour[:, :, 1])
    source = replay(tmp_path)
    source.open()
    first, second = frames_of(source, 2)
    assert (first.encoding, second.encoding) == (Encoding.BGR, Encoding.GREY)
    assert np.array_equal(np.asarray(first.data), colour)
    assert np.array_equal(np.asarray(second.data), colour[:, :, 1])


def test_a_picture_of_another_size_is_dropped(
    tmp_path: Path, make_jpeg: Callable[..., bytes], replay: Play, frames_of: Take
) -> None:
    for name, size in (("a", (64, 48)), ("b", (32, 24)), ("c", (64, 48))):
        (tmp_path / f"{name}.jpg").write_bytes(make_jpeg(0, *size))
    source = replay(tmp_path)
    source.open()
    next(frames_of(source, 1))
    with pytest.raises(CorruptFrameError, match=r"32x24.*64x48"):
        list(frames_of(source, 1))
    assert next(frames_of(source, 1)).sequence == 2


@pytest.mark.parametrize(
    ("make", "error"),
    [
        (lambda p: p / "missing.avi", FileMissingError),
        (lambda p: p, FileMissingError),
        (lambda p: (p / "a.mp4", (p / "a.mp4").write_bytes(b"no video"))[0], UnsupportedError),
        (lambda p: (p / "a.png", (p / "a.png").write_bytes(b"x"))[0], UnsupportedError),
    ],
    ids=["missing", "empty folder", "no video", "one picture"],
)
def test_unusable_recordings(
    tmp_path: Path, make: Callable[[Path], Path], error: type[Exception], replay: Play
) -> None:
    with pytest.raises(error):
        replay(make(tmp_path)).open()


def test_the_kind_of_recording_is_found_by_content(mjpeg_avi: Path, tmp_path: Path) -> None:
    disguised = tmp_path / "clip.mp4"
    shutil.copy(mjpeg_avi, disguised)
    assert isinstance(open_recording(disguised), AviRecording)
    folder = tmp_path / "folder"
    folder.mkdir()
    assert isinstance(open_recording(folder), FolderRecording)


@pytest.fixture
def spoilt_folder(tmp_path: Path, make_jpeg: Callable[..., bytes]) -> Path:
    """Eight things of which the fourth and the last are pictures of 320x240."""
    folder = tmp_path / "spoilt"
    folder.mkdir()
    (folder / "._a1.jpg").write_bytes(b"\0\5\26\7 AppleDouble")
    (folder / ".hidden.jpg").write_bytes(make_jpeg(0, 64, 48))
    (folder / "a1.jpg").write_bytes(b"\0\5\26\7 no picture")
    (folder / "a2.jpg").write_bytes(make_jpeg(2, 320, 240))
    os.mkfifo(folder / "a3.jpg")
    (folder / "a4.jpg").mkdir()
    (folder / "a5.png").write_bytes(b"")
    (folder / "a6.jpg").write_bytes(make_jpeg(6, 320, 240))
    return folder


def test_what_is_no_picture_in_a_folder_costs_one_frame_or_nothing(spoilt_folder: Path, replay: Play) -> None:
    source = replay(spoilt_folder)
    assert str(source.open()) == "MJPG 320x240 at 30 Hz"
    outcomes: list[object] = []
    while len(outcomes) < 8:
        try:
            frame = source.read(1.0)
        except CorruptFrameError as error:
            outcomes.append(str(error).rpartition("/")[2].split()[0].rstrip(":"))
        else:
            outcomes += [frame.width_px] if frame is not None else []
    assert outcomes == ["a1.jpg", 320, "a5.png", 320] * 2


def test_a_folder_without_a_usable_picture_is_refused_with_the_first_reason(tmp_path: Path, replay: Play) -> None:
    for name in ("a.jpg", "b.png"):
        (tmp_path / name).write_bytes(b"text")
    with pytest.raises(UnsupportedError, match=r"none of its 2 pictures can be used: .*a\.jpg"):
        replay(tmp_path).open()


@pytest.mark.parametrize("must_be_whole", [True, False])
def test_a_cut_jpeg_of_a_folder_is_played_where_corrupt_frames_are_not_dropped(
    tmp_path: Path, make_jpeg: Callable[..., bytes], must_be_whole: bool
) -> None:
    (tmp_path / "a.jpg").write_bytes(make_jpeg(0, 320, 240))
    (tmp_path / "b.jpg").write_bytes(make_jpeg(1, 320, 240)[:-40])
    source = Replay(open_recording(tmp_path), ModeRequest(), rate_hz=1000, must_be_whole=must_be_whole)
    source.open()
    assert source.read(1.0) is not None
    if must_be_whole:
        with pytest.raises(CorruptFrameError, match="end marker"):
            source.read(1.0)
    else:
        assert source.read(1.0) is not None


def test_a_picture_that_exif_turns_is_as_the_sensor_took_it(
    tmp_path: Path, make_jpeg: Callable[..., bytes], replay: Play
) -> None:
    directory = b"II*\0\x08\0\0\0\x01\0" + struct.pack("<HHIHH", 274, 3, 1, 6, 0) + bytes(4)
    payload = b"Exif\0\0" + directory
    data = make_jpeg(0, 320, 240)
    (tmp_path / "a.jpg").write_bytes(data[:2] + b"\xff\xe1" + struct.pack(">H", len(payload) + 2) + payload + data[2:])
    source = replay(tmp_path)
    assert (source.open().width_px, source.open().height_px) == (320, 240)
    frame = source.read(1.0)
    assert frame is not None
    pixels, encoding = decode(frame)
    assert (pixels.shape, encoding) == ((240, 320, 3), "bgr8")
