"""What the rows of the benchmark `trackers` say of a run."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from bench.trackers_runs import Run
from bench.trackers_scenes import FRAME_S, REQUEST_FRAME, Frame

_FIRST = 5  # pairs whose mean is where the tracker says that the point is
_MEAN = 5  # pairs whose mean error is drift, not noise
_OUTSIDE_PX = 5.0


@dataclass(frozen=True)
class Score:
    """Figures of one run; NaN where it gave no position.

    `rms_px`: of the error, less its mean over the first pairs: a centroid is another point than the one clicked.
    `drift_px`: largest mean error over five successive pairs. `jitter_px`: standard deviation of the error, both ways
    together. `lost`: share of the pairs that show the target in which there is no position. `false_locks`: times that
    the position comes to lie more than 5 px outside the target's true outline. `reacquired_s`: from the target's being
    in view again to the next position on it. `disparity_px`: RMS error of the disparity, its mean over the first pairs
    taken away. `ms`: CPU time of a pair.
    """

    rms_px: float
    drift_px: float
    jitter_px: float
    lost: float
    false_locks: float
    reacquired_s: float
    disparity_px: float
    ms: float

    def items(self) -> Iterator[tuple[str, float, str]]:
        """Yield name, value and unit of the figures that are rows."""
        yield "rms_px", self.rms_px, "px RMS"
        yield "drift_px", self.drift_px, "px"
        yield "lost", self.lost, "of pairs in view"
        yield "false_locks", self.false_locks, "times"
        yield "reacquired_s", self.reacquired_s, "s"
        yield "ms", self.ms, "ms of CPU a pair"


def score(frames: list[Frame], run: Run) -> Score:
    """Return the figures of a run through a sequence of frames."""
    shown = frames[REQUEST_FRAME:]
    truth = np.array([frame.left_px for frame in shown])
    seen = np.isfinite(run.left_px[:, 0])
    inside = np.array([_inside(frame, px) for frame, px in zip(shown, run.left_px, strict=True)])
    outside = seen & ~inside
    visible = np.array([frame.visible for frame in shown])
    lost = float((visible & ~seen).sum() / max(visible.sum(), 1))
    false_locks = float((outside & ~np.concatenate([[False], outside[:-1]])).sum())
    again = _reacquired_s(shown, seen & inside)
    errors = (run.left_px - truth)[seen]
    if not len(errors):
        nan = math.nan
        return Score(nan, nan, nan, lost, false_locks, again, nan, run.cpu_ms)
    # A point that is outside from the start is an error, not another point of the target.
    offset = errors[:_FIRST].mean(axis=0) if inside[seen][:_FIRST].all() else np.zeros(2)
    errors = errors - offset
    true_d = np.array([frame.left_px[0] - frame.right_px[0] for frame in shown])
    off_d = (run.disparity_px - true_d)[np.isfinite(run.disparity_px)]
    return Score(
        _rms(errors),
        _drift(errors),
        float(np.sqrt(errors.var(axis=0).sum())),
        lost,
        false_locks,
        again,
        _rms((off_d - off_d[:_FIRST].mean())[:, None]) if len(off_d) else math.nan,
        run.cpu_ms,
    )


def step_px(frames: list[Frame], run: Run, before: range, after: range) -> float:
    """Return how far the mean error moves from some pairs of a sequence to others [px]."""
    errors = run.left_px - np.array([frame.left_px for frame in frames[REQUEST_FRAME:]])
    means = [np.nanmean(errors[np.array(pairs) - REQUEST_FRAME], axis=0) for pairs in (before, after)]
    return float(np.linalg.norm(means[1] - means[0]))


def _inside(frame: Frame, px: NDArray[np.float64]) -> bool:
    if not np.isfinite(px).all():
        return False
    outline = frame.outline_px.astype(np.float32).reshape(-1, 1, 2)
    return bool(cv2.pointPolygonTest(outline, (float(px[0]), float(px[1])), True) >= -_OUTSIDE_PX)


def _reacquired_s(shown: list[Frame], found: NDArray[np.bool_]) -> float:
    """Return the time to find a target again that was hidden; NaN where it never was, infinite where it is not."""
    hidden = [k for k, frame in enumerate(shown) if frame.hidden]
    if not hidden:
        return math.nan
    back = next((k for k in range(hidden[-1], len(shown)) if shown[k].visible), None)
    if back is None:
        return math.nan
    again = next((k for k in range(back, len(shown)) if found[k]), None)
    return math.inf if again is None else (again - back) * FRAME_S


def _rms(errors: NDArray[np.float64]) -> float:
    return float(np.sqrt((errors**2).sum(axis=1).mean()))


def _drift(errors: NDArray[np.float64]) -> float:
    count = min(_MEAN, len(errors))
    means = np.stack([np.convolve(errors[:, axis], np.ones(count) / count, "valid") for axis in (0, 1)], axis=1)
    return float(np.linalg.norm(means, axis=1).max())
