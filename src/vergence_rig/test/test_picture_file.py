"""A picture is decoded only if its header claims a size that can be; whatever is no picture raises one error."""

import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vergence_rig.picture_file import LARGEST_PIXELS, decode_picture, read_picture
from vergence_rig.picture_size import picture_size
from vergence_rig.regular_file import FileError

SUFFIXES = (".png", ".jpg", ".bmp", ".tiff", ".webp", ".pgm", ".ppm", ".pbm")


def _encoded(suffix: str, width: int = 37, height: int = 23) -> bytes:
    shape = (height, width) if suffix in (".pgm", ".pbm") else (height, width, 3)
    done, data = cv2.imencode(suffix, np.full(shape, 99, np.uint8))
    assert done
    return bytes(data)


def _png_claiming(width: int, height: int) -> bytes:
    header = b"IHDR" + struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + header + struct.pack(">I", zlib.crc32(header))


def _claiming(suffix: str, width: int, height: int) -> bytes:
    """Return a picture of 37x23 px whose header says otherwise."""
    data = _encoded(suffix)
    if suffix == ".png":
        return _png_claiming(width, height) + data[33:]
    if suffix == ".bmp":
        return data[:18] + struct.pack("<ii", width, height) + data[26:]
    if suffix in (".pgm", ".ppm"):
        return data.replace(b"37 23", b"%d %d" % (width, height), 1)
    at = data.index(struct.pack(">HH", 23, 37))
    return data[:at] + struct.pack(">HH", height, width) + data[at + 4 :]


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_the_size_in_the_header_is_that_of_the_pixels(suffix: str) -> None:
    data = _encoded(suffix)
    assert picture_size(data) == (37, 23)
    assert decode_picture(data).shape == (23, 37, 3)


@pytest.mark.parametrize("suffix", [".png", ".bmp", ".pgm", ".ppm", ".jpg"])
@pytest.mark.parametrize("size", [(60000, 60000), (20000, 20000), (1, LARGEST_PIXELS + 1), (65535, 65535)])
def test_a_picture_that_claims_too_much_is_refused_with_its_size(suffix: str, size: tuple[int, int]) -> None:
    if suffix == ".jpg" and max(size) > 65535:
        pytest.skip("JPEG has 16 bits for a side")
    with pytest.raises(FileError, match=f"1 to 64 million px: got {size[0]}x{size[1]} px"):
        decode_picture(_claiming(suffix, *size))


@pytest.mark.parametrize("data", [b"", b"\0", b"hello", b"GIF89a" + bytes(100), b"\xff\xd8", b"BM", b"RIFF", b"P5"])
def test_what_is_no_picture_is_said_to_be_none(data: bytes) -> None:
    with pytest.raises(FileError, match="is not a picture"):
        decode_picture(data)


@settings(deadline=None)  # a damaged header may claim 64 million px
@given(st.sampled_from(SUFFIXES), st.integers(0, 4000), st.integers(0, 255), st.integers(0, 4000))
def test_a_damaged_picture_is_pixels_or_one_error(suffix: str, at: int, byte: int, length: int) -> None:
    data = bytearray(_encoded(suffix))
    data[at % len(data)] = byte
    lines = pixels = 0
    try:
        pixels = decode_picture(bytes(data[: length or None])).size
    except FileError as error:
        lines = len(str(error).splitlines())
    assert lines == 1 or 0 < pixels <= 3 * LARGEST_PIXELS


@given(st.sampled_from([_encoded(suffix)[:4] for suffix in SUFFIXES]), st.binary(max_size=200))
def test_no_header_raises(begin: bytes, rest: bytes) -> None:
    size = picture_size(begin + rest)
    assert size is None or min(size) >= 0


def test_a_picture_file_is_read_grey_or_in_colour(tmp_path: Path) -> None:
    path = tmp_path / "x.png"
    path.write_bytes(_encoded(".png"))
    assert read_picture(path).shape == (23, 37, 3)
    assert read_picture(path, cv2.IMREAD_GRAYSCALE).shape == (23, 37)
