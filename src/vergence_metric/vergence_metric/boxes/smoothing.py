"""Smoothing of boxes over time with a lag behind a steady motion that is set exactly."""

import itertools
import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from vergence_metric.boxes.detections import Box

Array = NDArray[np.float64]


class LagLimitedFilter:
    """First-order low pass of a vector: behind a ramp by `lag_s`, at any sampling, and no more.

    A sample's weight is dt / (dt + lag): at an even interval dt the lag behind a ramp is dt (1 - w) / w = lag.
    """

    def __init__(self, lag_s: float) -> None:
        self._lag_s = lag_s
        self._value: Array | None = None
        self._stamp_s = math.nan

    def reset(self) -> None:
        """Start anew: the next sample is returned as it is."""
        self._value = None

    def update(self, stamp_s: float, sample: Array) -> Array:
        """Add a sample (k,) and return the smoothed one; a stamp that does not increase starts anew."""
        if self._value is None or not stamp_s > self._stamp_s or self._value.shape != sample.shape:
            self._value = np.array(sample, np.float64)
        else:
            passed_s = stamp_s - self._stamp_s
            self._value = self._value + passed_s / (passed_s + self._lag_s) * (sample - self._value)
        self._stamp_s = stamp_s
        return self._value.copy()


def smoothed_pair(low_pass: LagLimitedFilter, stamp_s: float, left: Box, right: Box) -> tuple[Box, Box]:
    """Return a pair of boxes with the sides and landmarks that a filter gives for them."""
    boxes = (left, right)
    values = [np.array([*box.xyxy_px, *itertools.chain(*box.landmarks_px)]) for box in boxes]
    smoothed = low_pass.update(stamp_s, np.concatenate(values))
    parts = np.split(smoothed, [len(values[0])])
    return _moved(left, parts[0]), _moved(right, parts[1])


def _moved(box: Box, coordinates: Array) -> Box:
    """Return the box with these x and y (K,) of its corners and landmarks."""
    x_min, y_min, x_max, y_max, *landmarks = coordinates.tolist()
    points = tuple(zip(landmarks[::2], landmarks[1::2], strict=True))
    return replace(box, xyxy_px=(x_min, y_min, x_max, y_max), landmarks_px=points)
