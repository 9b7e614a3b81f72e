"""Buffers that are reused from pair to pair.

A measurement needs a few megabytes for some milliseconds. If they are allocated for every pair, the C library returns
them to the system in between, and a third of the time is spent on page faults.
"""

from math import prod
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray


class Scratch:
    """Arrays by name, for one thread; an array is valid until the same name is requested again."""

    def __init__(self) -> None:
        self._buffers: dict[str, NDArray[np.uint8]] = {}

    def array(self, name: str, shape: tuple[int, ...], dtype: DTypeLike) -> NDArray[Any]:
        """Return an uninitialised array of that shape and type, in the memory of the last one of that name."""
        needed = prod(shape) * np.dtype(dtype).itemsize
        if name not in self._buffers or self._buffers[name].size < needed:
            self._buffers[name] = np.empty(needed, np.uint8)
        return self._buffers[name][:needed].view(dtype).reshape(shape)
