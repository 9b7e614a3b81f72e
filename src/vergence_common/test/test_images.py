"""Image messages to numpy and back: every encoding, padded rows, and what a stranger may send."""

import array

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sensor_msgs.msg import CompressedImage, Image
from std_msgs.msg import Header

from vergence_common.encodings import ENCODINGS
from vergence_common.images import (
    ImageError,
    array_to_compressed,
    array_to_image,
    compressed_to_array,
    image_to_array,
    jpeg_to_compressed,
)


def _random(shape, seed=0):
    return np.random.default_rng(seed).integers(0, 256, shape, dtype=np.uint8)


def _yuv(bgr):
    """Studio-range luminance and chrominance (BT.601), as OpenCV reads them from packed and planar images."""
    b, g, r = (bgr[:, :, i].astype(float) for i in range(3))
    return (
        16 + 0.257 * r + 0.504 * g + 0.098 * b,
        128 - 0.148 * r - 0.291 * g + 0.439 * b,
        128 + 0.439 * r - 0.368 * g - 0.071 * b,
    )


def _packed(bgr, order):
    """Return (h, w, 2): luminance and, in turn, one of the two chrominances of a pair of pixels."""
    y, u, v = _yuv(bgr)
    chroma = np.empty_like(y)
    chroma[:, 0::2], chroma[:, 1::2] = u[:, 0::2], v[:, 0::2]
    return np.stack([(y, chroma)[i] for i in order], axis=2).round().astype(np.uint8)


def _semi_planar(bgr, order):
    """Return (3 h / 2, w): luminance, and below it the chrominances of every second pixel, interleaved."""
    planes = _yuv(bgr)
    chroma = np.stack([planes[i][0::2, 0::2] for i in order], axis=2).reshape(bgr.shape[0] // 2, -1)
    return np.vstack([planes[0], chroma]).round().astype(np.uint8)


def _mosaic(bgr, pattern):
    mosaic = np.empty(bgr.shape[:2], np.uint8)
    for place, colour in enumerate(pattern):
        row, column = divmod(place, 2)
        mosaic[row::2, column::2] = bgr[row::2, column::2, "bgr".index(colour)]
    return mosaic


@settings(deadline=None, max_examples=50)
@given(st.integers(1, 40), st.integers(1, 40), st.sampled_from(["bgr8", "mono8"]), st.integers(0, 2**32 - 1))
def test_round_trip(height, width, encoding, seed):
    pixels = _random((height, width) if encoding == "mono8" else (height, width, 3), seed)
    message = array_to_image(pixels, Header(frame_id="left_camera_optical_frame"), encoding)
    assert message.header.frame_id == "left_camera_optical_frame"
    assert np.array_equal(image_to_array(message), pixels)


def test_rgb8_becomes_bgr():
    pixels = _random((4, 5, 3))
    assert np.array_equal(image_to_array(array_to_image(pixels, Header(), "rgb8")), pixels[:, :, ::-1])


@settings(deadline=None, max_examples=30)
@given(
    st.integers(1, 9), st.integers(1, 9), st.integers(0, 7), st.sampled_from([("bgr8", 3), ("rgb8", 3), ("mono8", 1)])
)
def test_step_is_honoured(height, width, padding, encoding):
    name, channels = encoding
    step = width * channels + padding
    rows = _random((height, step))
    message = Image(height=height, width=width, step=step, encoding=name, data=array.array("B", rows.tobytes()))
    expected = rows[:, : width * channels].reshape(height, width, channels)
    expected = {"bgr8": expected, "rgb8": expected[:, :, ::-1], "mono8": expected[:, :, 0]}[name]
    assert np.array_equal(image_to_array(message), expected)


def test_bgr8_is_not_copied():
    message = array_to_image(_random((4, 5, 3)), Header())
    view = image_to_array(message)
    message.data[0] = (message.data[0] + 1) % 256
    assert view[0, 0, 0] == message.data[0]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"encoding": "32FC1"}, ["encoding", "32FC1", "bgr8"]),
        ({"height": 0}, ["5x0"]),
        ({"width": 0}, ["0x4"]),
        ({"step": 14}, ["step", "14", "15"]),
        ({"step": 16}, ["got 60", "64 bytes"]),
        ({"data": array.array("B", b"abc")}, ["got 3", "60 bytes"]),
        ({"height": 5}, ["got 60", "75 bytes"]),
    ],
)
def test_a_message_that_does_not_fit_is_named(changes, words):
    message = array_to_image(_random((4, 5, 3)), Header())
    for name, value in changes.items():
        setattr(message, name, value)
    with pytest.raises(ImageError) as raised:
        image_to_array(message)
    for word in words:
        assert word in str(raised.value)


@pytest.mark.parametrize(
    ("pixels", "encoding"),
    [
        (np.zeros((4, 5), np.uint8), "bgr8"),
        (np.zeros((4, 5, 3), np.uint8), "mono8"),
        (np.zeros((4, 5, 3), np.float32), "bgr8"),
        (np.zeros((4, 5, 4), np.uint8), "bgr8"),
        (np.zeros((4, 5, 3), np.uint8), "bgra8"),
    ],
)
def test_pixels_that_do_not_fit_are_refused(pixels, encoding):
    with pytest.raises(ImageError, match=encoding):
        array_to_image(pixels, Header(), encoding)


def test_jpeg_round_trip_is_close_and_bytes_pass_untouched():
    ramp = np.repeat(np.linspace(0, 255, 64, dtype=np.uint8)[None, :, None], 48, axis=0).repeat(3, axis=2)
    message = array_to_compressed(ramp, Header(), 95)
    assert np.abs(compressed_to_array(message).astype(int) - ramp).max() <= 4
    data = bytes(message.data)
    assert bytes(jpeg_to_compressed(data, Header()).data) == data


@pytest.mark.parametrize("data", [b"", b"\xff\xd8\xff garbage", bytes(100)])
def test_a_broken_jpeg_is_an_error_not_a_picture(data):
    with pytest.raises(ImageError):
        compressed_to_array(CompressedImage(format="jpeg", data=array.array("B", data)))


def _message(encoding, data, width, height, step, big_endian=False):
    message = Image(height=height, width=width, step=step, encoding=encoding, is_bigendian=int(big_endian))
    message.data = array.array("B", data)
    return message


SCENE = cv2.GaussianBlur(_random((48, 64, 3), 3), (0, 0), 4)
# How OpenCV itself makes each encoding of the scene, and how far the way back may be off on average.
MADE = {
    "bgr8": (SCENE, 0),
    "rgb8": (SCENE[:, :, ::-1], 0),
    "bgra8": (cv2.cvtColor(SCENE, cv2.COLOR_BGR2BGRA), 0),
    "rgba8": (cv2.cvtColor(SCENE, cv2.COLOR_BGR2RGBA), 0),
    "8UC3": (SCENE, 0),
    "8UC4": (cv2.cvtColor(SCENE, cv2.COLOR_BGR2BGRA), 0),
    "bgr16": (SCENE.astype(np.uint16) * 257, 0),
    "rgb16": (SCENE[:, :, ::-1].astype(np.uint16) * 257, 0),
    "16UC3": (SCENE.astype(np.uint16) * 257, 0),
    "rgba16": (cv2.cvtColor(SCENE, cv2.COLOR_BGR2RGBA).astype(np.uint16) * 257, 0),
    "nv21": (_semi_planar(SCENE, (2, 1)), 8),
    "nv12": (_semi_planar(SCENE, (1, 2)), 8),
    "yuv422": (_packed(SCENE, (1, 0)), 8),
    "uyvy": (_packed(SCENE, (1, 0)), 8),
    "yuv422_yuy2": (_packed(SCENE, (0, 1)), 8),
    "yuyv": (_packed(SCENE, (0, 1)), 8),
    **{
        f"bayer_{pattern}{bits}": (_mosaic(SCENE, pattern).astype(kind) * factor, 8)
        for pattern in ("rggb", "bggr", "gbrg", "grbg")
        for bits, kind, factor in ((8, np.uint8, 1), (16, np.uint16, 257))
    },
}


@pytest.mark.parametrize("encoding", sorted(MADE))
@pytest.mark.parametrize("padding", [0, 6])
@pytest.mark.parametrize("big_endian", [False, True])
def test_every_colour_encoding_gives_the_scene(encoding, padding, big_endian):
    stored, tolerance = MADE[encoding]
    if big_endian and stored.dtype != np.uint8:
        stored = stored.byteswap()
    rows = np.ascontiguousarray(stored).view(np.uint8).reshape(stored.shape[0], -1)
    rows = np.hstack([rows, np.zeros((len(rows), padding), np.uint8)])
    pixels = image_to_array(_message(encoding, rows.tobytes(), 64, 48, rows.shape[1], big_endian))
    assert pixels.shape == SCENE.shape
    assert pixels.dtype == np.uint8
    assert np.abs(pixels.astype(float) - SCENE).mean() <= tolerance


@pytest.mark.parametrize("encoding", ["mono8", "8UC1", "mono16", "16UC1"])
@pytest.mark.parametrize("big_endian", [False, True])
def test_every_grey_encoding_gives_the_grey_scene(encoding, big_endian):
    grey = SCENE[:, :, 1]
    stored = grey.astype(np.uint16) * 256 + 77 if encoding.endswith("16") or encoding.startswith("16") else grey
    stored = stored.byteswap() if big_endian else stored
    data = np.ascontiguousarray(stored).tobytes()
    assert np.array_equal(image_to_array(_message(encoding, data, 64, 48, len(data) // 48, big_endian)), grey)


def test_the_table_has_no_encoding_without_a_test():
    assert set(ENCODINGS) - set(MADE) == {"mono8", "8UC1", "mono16", "16UC1", "bgra16", "16UC4"}


@settings(deadline=None, max_examples=200)
@given(
    st.sampled_from(sorted(ENCODINGS)) | st.text(max_size=8),
    st.integers(0, 9),
    st.integers(0, 9),
    st.integers(0, 80),
    st.integers(-3, 3),
)
def test_any_fields_are_pixels_or_one_named_error(encoding, width, height, step, missing):
    known = ENCODINGS.get(encoding)
    rows = height * known.rows_per_two // 2 if known else height
    message = _message(encoding, bytes(max(step * rows + missing, 0)), width, height, step)
    try:
        pixels = image_to_array(message)
    except ImageError as error:
        assert len(str(error).splitlines()) == 1  # noqa: PT017
    else:
        assert pixels.shape[:2] == (height, width)
