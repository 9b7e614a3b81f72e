"""Limits the threads of every BLAS that is loaded: numpy's own, the system's, OpenCV's.

Their pools wait by spinning: numpy 1.26's OpenBLAS takes a third of a core from other nodes for products that one
thread does sooner. An environment variable would have to be set before numpy is imported.
"""

import ctypes
from collections.abc import Iterator

_SETTERS = (
    "openblas_set_num_threads",
    "openblas_set_num_threads64_",
    "scipy_openblas_set_num_threads",
    "scipy_openblas_set_num_threads64_",
    "MKL_Set_Num_Threads",
    "bli_thread_set_num_threads",
)
_NAMES = ("blas", "mkl_rt", "blis")
_MAPS = "/proc/self/maps"


def limit_blas_threads(count: int = 1) -> list[str]:
    """Let every loaded BLAS use at most `count` threads; returns the libraries that were limited.

    A library that is loaded later is not limited. Where libraries cannot be listed, nothing is done.
    """
    limited = []
    for path in _loaded():
        try:
            library = ctypes.CDLL(path)
        except OSError:
            continue
        for name in _SETTERS:
            setter = getattr(library, name, None)
            if setter is not None:
                setter(ctypes.c_int(count))
                limited.append(path)
                break
    return limited


def _loaded() -> Iterator[str]:
    """Yield the path of every loaded library whose name is that of a BLAS."""
    try:
        with open(_MAPS, encoding="utf-8", errors="replace") as maps:
            paths = {line.split(maxsplit=5)[5].strip() for line in maps if line.count("/")}
    except OSError:
        return
    for path in sorted(paths):
        name = path.rpartition("/")[2]
        if ".so" in name and any(part in name for part in _NAMES):
            yield path
