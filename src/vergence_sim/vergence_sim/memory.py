"""Memory that the C library keeps for itself after it was freed."""

import ctypes
import mmap
from collections.abc import Callable

import numpy as np
import numpy.typing as npt


def _trim() -> Callable[[int], int] | None:
    try:
        trim: Callable[[int], int] = ctypes.CDLL(None).malloc_trim
    except (OSError, AttributeError):  # not glibc
        return None
    return trim


_MALLOC_TRIM = _trim()


def _advise() -> Callable[..., int] | None:
    try:
        advise: Callable[..., int] = ctypes.CDLL(None).madvise
    except (OSError, AttributeError):  # not POSIX
        return None
    return advise


_MADVISE = _advise() if hasattr(mmap, "MADV_DONTNEED") else None


def return_free_memory() -> None:
    """Return freed memory to the operating system; does nothing where the C library is not glibc.

    Building and drawing a room frees several hundred MB, in the arena of whichever thread did it, and glibc would keep
    them: once for every thread.
    """
    if _MALLOC_TRIM is not None:
        _MALLOC_TRIM(0)


def discard_pages(values: npt.NDArray[np.generic]) -> None:
    """Give the whole pages under an array back to the operating system; they read as zeros from then on."""
    begin, size = values.ctypes.data, mmap.PAGESIZE
    pages = range(-(-begin // size) * size, (begin + values.nbytes) // size * size)
    if _MADVISE is not None and len(pages):
        _MADVISE(ctypes.c_void_p(pages.start), ctypes.c_size_t(len(pages)), mmap.MADV_DONTNEED)
