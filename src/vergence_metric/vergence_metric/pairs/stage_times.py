"""Recent durations of each stage of measuring a pair."""

from collections import deque
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from time import perf_counter

import numpy as np

_RECENT = 150


class StageTimes:
    """Durations by stage, over the latest pairs. One thread adds; another may read."""

    def __init__(self) -> None:
        self._seconds: dict[str, deque[float]] = {}

    def add(self, stage: str, seconds: float) -> None:
        """Add one duration of a stage [s]."""
        self._seconds.setdefault(stage, deque(maxlen=_RECENT)).append(seconds)

    def add_all(self, stage_s: Mapping[str, float]) -> None:
        """Add one duration of each stage [s]."""
        for stage, seconds in stage_s.items():
            self.add(stage, seconds)

    @contextmanager
    def measure(self, stage: str) -> Iterator[None]:
        """Add the duration of the block to the stage, unless the block raises."""
        started = perf_counter()
        yield
        self.add(stage, perf_counter() - started)

    def summary(self) -> dict[str, float]:
        """Return `<stage>_median_ms` and `<stage>_p99_ms` of every stage, in order of their first addition [ms]."""
        figures = {}
        for stage, recent in list(self._seconds.items()):
            median, high = np.percentile(recent.copy(), (50, 99)) * 1e3
            figures[f"{stage}_median_ms"] = float(median)
            figures[f"{stage}_p99_ms"] = float(high)
        return figures
