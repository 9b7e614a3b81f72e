"""The one table of image encodings: how the bytes of a sensor_msgs/Image become BGR or grey pixels.

Names are those of sensor_msgs/image_encodings.hpp. Of sixteen bits the upper eight are kept, as cv_bridge does.
"""

from dataclasses import dataclass

import cv2


@dataclass(frozen=True)
class ImageEncoding:
    """How an image is stored.

    Attributes:
        channels: numbers for each pixel of a row.
        bits: of one number, 8 or 16.
        conversion: OpenCV's code to BGR; None where the pixels are grey or BGR already.
        rows_per_two: rows of data for two rows of the image: 3 with half a plane of colours below the grey one.
        even: whether width (and height, with planes) must be even.
    """

    channels: int
    bits: int = 8
    conversion: int | None = None
    rows_per_two: int = 2
    even: bool = False


def _colour() -> dict[str, ImageEncoding]:
    codes = {
        "bgr": (3, None),
        "rgb": (3, cv2.COLOR_RGB2BGR),
        "bgra": (4, cv2.COLOR_BGRA2BGR),
        "rgba": (4, cv2.COLOR_RGBA2BGR),
        "mono": (1, None),
        # OpenCV names a pattern by its second row, ROS by its first.
        "bayer_rggb": (1, cv2.COLOR_BayerBG2BGR),
        "bayer_bggr": (1, cv2.COLOR_BayerRG2BGR),
        "bayer_gbrg": (1, cv2.COLOR_BayerGR2BGR),
        "bayer_grbg": (1, cv2.COLOR_BayerGB2BGR),
    }
    return {
        f"{name}{bits}": ImageEncoding(channels, bits, code)
        for bits in (8, 16)
        for name, (channels, code) in codes.items()
    }


def _generic() -> dict[str, ImageEncoding]:
    """OpenCV's own types: three channels are taken for BGR, four for BGRA."""
    codes = {1: None, 3: None, 4: cv2.COLOR_BGRA2BGR}
    return {
        f"{bits}UC{channels}": ImageEncoding(channels, bits, code)
        for bits in (8, 16)
        for channels, code in codes.items()
    }


def _luminance_and_chrominance() -> dict[str, ImageEncoding]:
    uyvy = ImageEncoding(2, 8, cv2.COLOR_YUV2BGR_UYVY, even=True)
    yuyv = ImageEncoding(2, 8, cv2.COLOR_YUV2BGR_YUYV, even=True)
    return {
        "yuv422": uyvy,
        "uyvy": uyvy,
        "yuv422_yuy2": yuyv,
        "yuyv": yuyv,
        "nv21": ImageEncoding(1, 8, cv2.COLOR_YUV2BGR_NV21, rows_per_two=3, even=True),
        "nv12": ImageEncoding(1, 8, cv2.COLOR_YUV2BGR_NV12, rows_per_two=3, even=True),
    }


ENCODINGS: dict[str, ImageEncoding] = {**_colour(), **_generic(), **_luminance_and_chrominance()}
"""Every encoding that is taken, by its name in a message."""

PUBLISHED = ("bgr8", "rgb8", "mono8")
"""Those in which images are published here."""
