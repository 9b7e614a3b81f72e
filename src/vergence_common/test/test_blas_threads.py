"""Every BLAS that is loaded is limited, whichever numpy is installed."""

import ctypes

import numpy as np
import pytest

from vergence_common import blas_threads
from vergence_common.blas_threads import limit_blas_threads

GETTERS = tuple(name.replace("_set_", "_get_") for name in blas_threads._SETTERS if "openblas" in name)


def counts(paths: list[str]) -> list[int]:
    """Return the number of threads that each OpenBLAS now uses."""
    libraries = [ctypes.CDLL(path) for path in paths]
    return [int(getattr(one, name)()) for one in libraries for name in GETTERS if hasattr(one, name)]


def test_all_loaded_libraries_are_limited() -> None:
    np.linalg.inv(np.eye(3))
    paths = limit_blas_threads(2)
    if not counts(paths):
        pytest.skip("no OpenBLAS is loaded: numpy uses another BLAS")
    assert all(count <= 2 for count in counts(paths))
    assert limit_blas_threads(1) == paths
    assert set(counts(paths)) == {1}


def test_nothing_is_done_where_libraries_cannot_be_listed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(blas_threads, "_MAPS", "/nowhere/maps")
    assert limit_blas_threads() == []
