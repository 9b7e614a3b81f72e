"""Gain and offset between the eyes about a point: semi-global matching compares grey values as they are."""

from collections.abc import Sequence

import cv2
import numpy as np

from vergence_metric.disparity.candidates import Profile
from vergence_metric.disparity.fovea_pair import FoveaPair, Grey, cut
from vergence_metric.disparity.protocol import Image

_HALF_PX = 30
_LEAST_CORRELATION = 0.7
_LARGEST_GAIN = 2.0


def lit_alike(pair: FoveaPair, layers: Sequence[Profile], rows_px: int) -> Image:
    """Return the right image with the mean and deviation of the left one where the largest window matches.

    Where that matches too poorly to be compared, the strips as wholes are made alike. Only the rows up to `rows_px`
    above and below the point are changed.
    """
    layer = next((one for one in reversed(layers) if one.textured), layers[-1])
    peaks = layer.peaks
    if len(peaks) and layer.at(float(peaks[0])) >= _LEAST_CORRELATION:
        x, y = round(pair.point_px[0]) - _HALF_PX, round(pair.point_px[1]) - _HALF_PX
        side = 2 * _HALF_PX + 1
        seen: tuple[Grey | Image, Grey | Image]
        seen = cut(pair.left, x, y, side, side), cut(pair.right, x - int(peaks[0]), y, side, side)
    else:
        seen = pair.half[0].grey, pair.half[1].grey
    (left_mean, left_deviation), (right_mean, right_deviation) = (
        (float(moment[0, 0]) for moment in cv2.meanStdDev(one)) for one in seen
    )
    gain = min(max(left_deviation / max(right_deviation, 1.0), 1.0 / _LARGEST_GAIN), _LARGEST_GAIN)
    table = np.clip(np.rint(gain * (np.arange(256) - right_mean) + left_mean), 0, 255).astype(np.uint8)
    alike, top = pair.right.copy(), max(round(pair.point_px[1]) - rows_px, 0)
    band = slice(top, round(pair.point_px[1]) + rows_px + 1)
    alike[band] = cv2.LUT(pair.right[band], table)
    return alike
