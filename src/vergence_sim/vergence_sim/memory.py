"""Memory that the C library keeps for itself after it was freed."""

import ctypes
from collections.abc import Callable


def _trim() -> Callable[[int], int] | None:
    try:
        trim: Callable[[int], int] = ctypes.CDLL(None).malloc_trim
    except (OSError, AttributeError):  # not glibc
        return None
    return trim


_MALLOC_TRIM = _trim()


def return_free_memory() -> None:
    """Return freed memory to the operating system; does nothing where the C library is not glibc.

    Building and drawing a room frees several hundred MB, in the arena of whichever thread did it, and glibc would keep
    them: once for every thread.
    """
    if _MALLOC_TRIM is not None:
        _MALLOC_TRIM(0)
