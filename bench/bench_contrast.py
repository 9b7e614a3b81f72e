"""How well contrast separates vergence from clutter on held-out scenes, and how far windows agree."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from bench.contrast_renders import frames
from bench.contrast_scenes import (
    FITTED_DRAWINGS,
    FITTED_PHOTOGRAPHS,
    HARD,
    UNSEEN_DRAWINGS,
    UNSEEN_PHOTOGRAPHS,
    Degradation,
    LabelledPair,
    cut,
    exposed,
    labelled_pairs,
    textured,
)
from bench.results import Row
from vergence_metric.alignment.parameters import AlignmentParameters
from vergence_metric.edges.parameters import EdgeParameters
from vergence_metric.measurement.edge_metric import EdgeMetric, EdgeMetricResult
from vergence_rig.rig import EyeMount, default_rig
from vergence_sim.heads import rolled_head
from vergence_sim.parameters import SimParameters

EDGES = EdgeParameters(windows_px=(50, 100))
UNALIGNED = AlignmentParameters(mode="none")
THRESHOLD = 0.6  # of the Gaussian-weighted contrast
PAIRS = 600
LARGEST_VERGED_PX, SMALLEST_UNVERGED_PX, LARGEST_UNVERGED_PX = 1.0, 8.0, 150.0


def run(say: Callable[[str], None]) -> list[Row]:
    """Measure the classification of hard and clean held-out pairs, then the windows' agreement."""
    fitted, _, _ = _best(*(_foveal(m) for m in _measured(FITTED_DRAWINGS, FITTED_PHOTOGRAPHS, HARD, seed=10)))
    say(f"threshold that fits the fitted scenes best: {fitted:.2f}; shipped: {THRESHOLD:g}")
    rows: list[Row] = []
    for suffix, degradation in (("", HARD), (".clean", Degradation())):
        verged, unverged = _measured(UNSEEN_DRAWINGS, UNSEEN_PHOTOGRAPHS, degradation, seed=20, real=True)
        say(
            f"{suffix or '.hard'}: error {_balanced_error(_foveal(verged), _foveal(unverged), fitted):.2%} at the "
            "fitted threshold"
        )
        rows += _judged(say, suffix, verged, unverged)
    rows += _judged(say, ".rendered", *_rendered_pairs())
    return rows + _window_spread(say)


def _judged(
    say: Callable[[str], None], suffix: str, verged: list[EdgeMetricResult], unverged: list[EdgeMetricResult]
) -> list[Row]:
    """Return the rows of one set: error at the shipped threshold, and misses where one in 100 unverged passes."""
    contrast = _foveal(verged), _foveal(unverged)
    at_shipped = _balanced_error(*contrast, THRESHOLD)
    _, _, missed = _best(*contrast)
    raw = [_best(_raw(verged, window), _raw(unverged, window)) for window in range(len(EDGES.windows_px))]
    raw_error, raw_missed = min(figures[1] for figures in raw), min(figures[2] for figures in raw)
    say(
        f"{suffix or '.hard'}: {len(verged)} verged, {len(unverged)} not; error {at_shipped:.2%} at the shipped "
        f"threshold, {_best(*contrast)[1]:.2%} at the best ({_best(*contrast)[0]:.2f}); raw metric {raw_error:.2%} "
        f"at its best; medians {np.median(contrast[0]):.2f} and {np.median(contrast[1]):.2f}"
    )
    against = "raw metric at its best threshold and window"
    return [
        Row(f"contrast.balanced_error{suffix}", 100 * at_shipped, "%", against, 100 * raw_error),
        Row(f"contrast.missed_at_1pct_false{suffix}", 100 * missed, "%", against, 100 * raw_missed),
    ]


def _measured(
    drawings: tuple[str, ...],
    photographs: tuple[str, ...],
    degradation: Degradation,
    seed: int,
    real: bool = False,
) -> tuple[list[EdgeMetricResult], list[EdgeMetricResult]]:
    """Return what is measured on verged and on unverged pairs."""
    results = []
    for offset, disparity in ((0, _verged_disparity), (1, _unverged_disparity)):
        rng = np.random.default_rng(seed + offset)
        pairs = list(labelled_pairs(rng, drawings, photographs, PAIRS, degradation, disparity))
        if real:
            pairs += list(stereo_pairs(rng, PAIRS // 6, degradation, disparity))
        results.append([EdgeMetric(EDGES, alignment=UNALIGNED).measure(pair.left, pair.right) for pair in pairs])
    return results[0], results[1]


def _verged_disparity(rng: np.random.Generator) -> float:
    return float(rng.uniform(-LARGEST_VERGED_PX, LARGEST_VERGED_PX))


def _unverged_disparity(rng: np.random.Generator) -> float:
    size = np.exp(rng.uniform(np.log(SMALLEST_UNVERGED_PX), np.log(LARGEST_UNVERGED_PX)))
    return float(rng.choice([-1.0, 1.0]) * size)


@cache
def _motorcycle() -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
    from skimage import data

    left, right, disparity = data.stereo_motorcycle()
    grey = [cv2.cvtColor(image, cv2.COLOR_RGB2GRAY).astype(np.float32) for image in (left, right)]
    return grey[0], grey[1], disparity.astype(np.float32)


def stereo_pairs(
    rng: np.random.Generator, count: int, degradation: Degradation, disparity_px: Callable[[np.random.Generator], float]
) -> Iterator[LabelledPair]:
    """Yield views of a real stereo pair (Middlebury's motorcycle) about points of known disparity.

    Only points whose depth fills half of the 50 px around them: where nothing does, nothing there can be verged on.
    """
    left, right, truth = _motorcycle()
    side, made = 160, 0
    while made < count:
        x, y = (int(rng.integers(side // 2 + 4, n - side // 2 - 4)) for n in reversed(truth.shape))
        about, wanted = truth[y - 25 : y + 25, x - 25 : x + 25], disparity_px(rng)
        with np.errstate(invalid="ignore"):
            alike = np.abs(about - truth[y, x]) <= LARGEST_VERGED_PX
        right_x = x - float(truth[y, x]) + wanted
        room = side / 2 + 6
        if not alike.mean() >= 0.5 or not room < right_x < truth.shape[1] - room:
            continue
        left_view = cut(left, x, y, side, side)
        if textured(left_view):
            made += 1
            right_view = cut(right, right_x, y, side, side, degradation.roll_rad)
            yield LabelledPair(
                exposed(left_view, rng, degradation.noise_sigma),
                exposed(right_view, rng, degradation.noise_sigma, degradation.gain),
                wanted,
                "motorcycle",
            )


def _rendered_pairs() -> tuple[list[EdgeMetricResult], list[EdgeMetricResult]]:
    """Return what is measured on a rendered cube that fills the 50 px window, degraded as hard pairs are."""
    hard = SimParameters.of(
        {
            "camera.noise_sigma": HARD.noise_sigma,
            "right_camera.gain": HARD.gain,
        }
    )
    head = replace(rolled_head(default_rig()), left_mount=EyeMount(), right_mount=EyeMount(roll_rad=HARD.roll_rad))
    errors = [0.0, *np.deg2rad([1.0, -1.2, 2.5, -3.0, 5.0])]
    verged: list[EdgeMetricResult] = []
    unverged: list[EdgeMetricResult] = []
    for error_rad, frame in frames(hard, range(20, 23), 16, errors, seed=7, head=head):
        if frame.truth.target == "cube" and np.linalg.norm(frame.truth.target_point_m) < 0.6:
            result = EdgeMetric(EDGES, alignment=UNALIGNED).measure(frame.left, frame.right)
            (verged if error_rad == 0.0 else unverged).append(result)
    return verged, unverged


def _foveal(results: list[EdgeMetricResult]) -> NDArray[np.float64]:
    return np.nan_to_num(np.array([result.foveal_contrast for result in results]), nan=9.0)


def _raw(results: list[EdgeMetricResult], window: int) -> NDArray[np.float64]:
    means = [(r.left_to_right_px[window] + r.right_to_left_px[window]) / 2 for r in results]
    return np.nan_to_num(np.array(means), nan=1e3)


def _balanced_error(verged: NDArray[np.float64], unverged: NDArray[np.float64], threshold: float) -> float:
    return float(((verged > threshold).mean() + (unverged <= threshold).mean()) / 2)


def _best(verged: NDArray[np.float64], unverged: NDArray[np.float64]) -> tuple[float, float, float]:
    """Return the best threshold, its balanced error, and the share missed where 1 % of the unverged pass.

    The threshold lies in the middle of all that are as good.
    """
    thresholds = np.unique(np.concatenate([verged, unverged]))
    errors = np.array([_balanced_error(verged, unverged, t) for t in thresholds])
    best = np.flatnonzero(errors <= errors.min() + 1e-12)
    threshold = float((thresholds[best[0]] + thresholds[min(best[-1] + 1, len(thresholds) - 1)]) / 2)
    strict = thresholds[np.array([(unverged <= t).mean() for t in thresholds]) <= 0.01]
    missed = float((verged > strict.max()).mean()) if strict.size else 1.0
    return threshold, float(errors.min()), missed


def _window_spread(say: Callable[[str], None]) -> list[Row]:
    """Return how far the windows of 100 to 300 px agree on a verged target before a room."""
    edges = EdgeParameters(windows_px=(100, 150, 200, 250, 300))
    plain: list[float] = []
    robust: list[float] = []
    for _, frame in frames(SimParameters.of({"head.model": "rolled"}), range(30, 33), 10, [0.0], seed=9):
        result = EdgeMetric(edges).measure(frame.left, frame.right)
        for figures, into in (
            (result.left_to_right_px, plain),
            (result.right_to_left_px, plain),
            (result.robust_left_to_right_px, robust),
            (result.robust_right_to_left_px, robust),
        ):
            if np.isfinite(figures).all():
                into.append(float((figures.max() - figures.min()) / figures.mean()))
    say(
        f"spread of the windows at vergence over {len(robust)} directions: plain {np.mean(plain):.2f} (worst "
        f"{max(plain):.2f}), robust {np.mean(robust):.3f} (worst {max(robust):.3f})"
    )
    return [
        Row("robust.window_spread", float(np.mean(robust)), "(max-min)/mean", "plain metric", float(np.mean(plain))),
        Row("robust.window_spread.worst", max(robust), "(max-min)/mean", "plain metric", max(plain)),
    ]
