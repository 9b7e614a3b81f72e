"""Memory that is kept from pair to pair.

A measurement needs a few megabytes for some milliseconds. Asked anew for every pair, the C library gives them back to
the system in between, and a third of the time goes into the page faults of touching them again.
"""

from math import prod
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray


class Scratch:
    """Arrays by name, for one thread; what is in them holds until the same name is asked for again."""

    def __init__(self) -> None:
        self._buffers: dict[str, NDArray[np.uint8]] = {}

    def array(self, name: str, shape: tuple[int, ...], dtype: DTypeLike) -> NDArray[Any]:
        """Return an array of that shape and type with anything in it; the memory is that of the last one so named."""
        needed = prod(shape) * np.dtype(dtype).itemsize
        if name not in self._buffers or self._buffers[name].size < needed:
            self._buffers[name] = np.empty(needed, np.uint8)
        return self._buffers[name][:needed].view(dtype).reshape(shape)
