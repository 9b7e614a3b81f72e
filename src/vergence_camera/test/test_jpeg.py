"""A JPEG's size and wholeness are read from its markers alone."""

from collections.abc import Callable

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vergence_camera import jpeg
from vergence_camera.errors import CorruptFrameError
from vergence_camera.jpeg import inspect_jpeg

Make = Callable[..., bytes]


@pytest.mark.parametrize("size", [(640, 480), (1280, 720), (17, 9)])
def test_reads_the_size_and_where_the_picture_ends(make_jpeg: Make, size: tuple[int, int]) -> None:
    data = make_jpeg(0, *size)
    info = inspect_jpeg(data)
    assert (info.width_px, info.height_px, info.components) == (*size, 3)
    assert info.end == len(data)


def test_padding_behind_the_picture_is_no_damage(make_jpeg: Make) -> None:
    data = make_jpeg()
    assert inspect_jpeg(data + bytes(4096)).end == len(data)


@pytest.mark.parametrize("flags", [[cv2.IMWRITE_JPEG_PROGRESSIVE, 1], [cv2.IMWRITE_JPEG_RST_INTERVAL, 4]])
def test_progressive_pictures_and_restart_markers_are_whole(
    make_pixels: Callable[..., np.ndarray], flags: list[int]
) -> None:
    data = bytes(cv2.imencode(".jpg", make_pixels(0), flags)[1])
    assert inspect_jpeg(data).end == len(data)


def test_a_grey_picture_has_one_component() -> None:
    data = bytes(cv2.imencode(".jpg", np.full((48, 64), 90, np.uint8))[1])
    assert inspect_jpeg(data).components == 1


@settings(deadline=None, max_examples=60)
@given(st.data())
def test_every_truncation_is_noticed(make_jpeg: Make, data: st.DataObject) -> None:
    whole = make_jpeg(1, 160, 120)
    cut = data.draw(st.integers(0, len(whole) - 1))
    with pytest.raises(CorruptFrameError):
        inspect_jpeg(whole[:cut])


def test_a_foreign_marker_in_the_coded_data_is_noticed(make_jpeg: Make) -> None:
    whole = make_jpeg()
    middle = len(whole) // 2
    with pytest.raises(CorruptFrameError, match="foreign"):
        inspect_jpeg(whole[:middle] + b"\xff\xc0\x00\x02" + whole[middle:])


def test_two_pictures_run_together_are_noticed(make_jpeg: Make) -> None:
    whole = make_jpeg()
    with pytest.raises(CorruptFrameError):
        inspect_jpeg(whole[: len(whole) // 2] + whole)


@settings(deadline=None, max_examples=200)
@given(st.binary(max_size=300))
def test_noise_never_crashes(noise: bytes) -> None:
    for data in (noise, b"\xff\xd8" + noise, b"\xff\xd8\xff\xc0\x00\x11\x08" + noise):
        try:
            info = inspect_jpeg(data)
        except CorruptFrameError:
            continue
        assert info.width_px > 0
        assert info.height_px > 0


def test_a_missing_end_can_be_let_pass(make_jpeg: Make) -> None:
    cut = make_jpeg()[:-2]
    with pytest.raises(CorruptFrameError):
        inspect_jpeg(cut)
    assert inspect_jpeg(cut, must_be_whole=False).width_px == 640


def test_the_memory_of_headers_changes_nothing(make_jpeg: Make) -> None:
    """A stream's headers are alike, but the next frame may be of another size, or damaged in its header."""
    small, large = make_jpeg(0, 64, 48), make_jpeg(0, 320, 240)
    for data, width in ((small, 64), (make_jpeg(1, 64, 48), 64), (large, 320), (small, 64)):
        assert inspect_jpeg(data).width_px == width
    for cut in (5, 100, small.index(b"\xff\xda") + 3):
        with pytest.raises(CorruptFrameError):
            inspect_jpeg(small[:cut])
    with pytest.raises(CorruptFrameError):
        inspect_jpeg(b"\xff\xd8" + bytes(20) + small[22:])


@settings(deadline=None, max_examples=200)
@given(st.data())
def test_a_damaged_picture_is_judged_alike_whether_its_header_was_seen_before_or_not(
    make_jpeg: Make, data: st.DataObject
) -> None:
    whole = make_jpeg(0, 64, 48)
    cut = data.draw(st.integers(0, len(whole)))
    place = data.draw(st.integers(0, len(whole) - 1))
    damaged = (whole[:place] + data.draw(st.binary(max_size=3)) + whole[place + 1 :])[:cut]

    def verdict() -> object:
        try:
            return inspect_jpeg(damaged, must_be_whole=False)
        except CorruptFrameError as error:
            return str(error)

    jpeg._headers_by_bytes.clear()
    fresh = verdict()
    inspect_jpeg(whole)
    assert verdict() == fresh
    assert verdict() == fresh
