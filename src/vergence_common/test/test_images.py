"""Image messages to numpy and back: every encoding, padded rows, and what a stranger may send."""

import array

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sensor_msgs.msg import CompressedImage, Image
from std_msgs.msg import Header

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
        ({"encoding": "yuv422"}, ["encoding", "yuv422", "bgr8"]),
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
