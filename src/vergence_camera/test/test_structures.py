"""The request numbers hold the sizes of the structures: these are what a C compiler gives on x86-64 and aarch64."""

import ctypes

import pytest

from vergence_camera.v4l2 import structures as v4l2

NUMBERS = {
    "QUERYCAP": 0x80685600,
    "ENUM_FMT": 0xC0405602,
    "G_FMT": 0xC0D05604,
    "S_FMT": 0xC0D05605,
    "REQBUFS": 0xC0145608,
    "QUERYBUF": 0xC0585609,
    "QBUF": 0xC058560F,
    "DQBUF": 0xC0585611,
    "STREAMON": 0x40045612,
    "STREAMOFF": 0x40045613,
    "G_PARM": 0xC0CC5615,
    "S_PARM": 0xC0CC5616,
    "G_CTRL": 0xC008561B,
    "S_CTRL": 0xC008561C,
    "QUERYCTRL": 0xC0445624,
    "QUERYMENU": 0xC02C5625,
    "ENUM_FRAMESIZES": 0xC02C564A,
    "ENUM_FRAMEINTERVALS": 0xC034564B,
    "QUERY_EXT_CTRL": 0xC0E85667,
}


@pytest.mark.skipif(ctypes.sizeof(ctypes.c_long) != 8, reason="the numbers below are those of a 64-bit kernel")
@pytest.mark.parametrize("name", NUMBERS)
def test_request_numbers(name: str) -> None:
    assert getattr(v4l2, name) == NUMBERS[name]


@pytest.mark.skipif(ctypes.sizeof(ctypes.c_long) != 8, reason="the offsets below are those of a 64-bit kernel")
@pytest.mark.parametrize(
    ("structure", "field", "offset"),
    [
        (v4l2.Buffer, "timestamp", 24),
        (v4l2.Buffer, "sequence", 56),
        (v4l2.Buffer, "m", 64),
        (v4l2.Buffer, "length", 72),
        (v4l2.Format, "fmt", 8),
        (v4l2.StreamParameters, "parm", 4),
        (v4l2.QueryMenu, "item", 8),
        (v4l2.QueryExtControl, "minimum", 40),
        (v4l2.QueryExtControl, "flags", 72),
        (v4l2.Capability, "device_caps", 88),
    ],
)
def test_offsets(structure: type[ctypes.Structure], field: str, offset: int) -> None:
    assert getattr(structure, field).offset == offset


def test_four_character_codes() -> None:
    assert v4l2.fourcc("MJPG") == 0x47504A4D
    assert v4l2.fourcc_text(0x56595559) == "YUYV"
    assert v4l2.fourcc_text(v4l2.fourcc("Y16")) == "Y16"
