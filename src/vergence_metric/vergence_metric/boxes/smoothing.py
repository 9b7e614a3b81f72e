"""Smoothing of boxes over time with a lag behind a steady motion that is set exactly."""

import math

import numpy as np
from numpy.typing import NDArray

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
