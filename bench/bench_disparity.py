"""Signed disparity at the fovea: every estimator and its peers on the same pairs, and their confidence."""

import math
import time
from collections.abc import Callable, Iterable

import cv2
import numpy as np
from numpy.typing import NDArray
from skimage.registration import phase_cross_correlation

from bench.disparity_pairs import Pair, clean, deceptive, hard
from bench.disparity_scenes import scenes
from bench.results import Row
from vergence_metric.disparity import estimator_names, make_estimator
from vergence_metric.disparity.parameters import DisparityParameters

Image = NDArray[np.uint8]
Point = tuple[float, float]

_PAIRS = 100
_SCENES = 100
_DECEPTIVE = 1000
_REACH_PX = 8.0  # within reach of the peers, which search no further than their windows; ours search all 160 px
_WINDOWS_PX = (32, 64, 128)  # each peer is judged by its best
_WRONG_PX = 2.0


def run(say: Callable[[str], None]) -> list[Row]:
    """Measure; each estimator's row has the best peer beside it."""
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        rows: list[Row] = []
        for condition, cases in _conditions():
            say(f"{condition}: {estimator_names()} and peers")
            rows += _accuracy(condition, cases)
        say(f"{_DECEPTIVE} pairs without an answer")
        return rows + _deceived()
    finally:
        cv2.setNumThreads(threads)


def _conditions() -> Iterable[tuple[str, list[tuple[Image, Image, Point, float]]]]:
    def at_centre(pairs: Iterable[Pair]) -> list[tuple[Image, Image, Point, float]]:
        return [(p.left, p.right, (319.5, 239.5), float(p.disparity_px or 0.0)) for p in pairs]

    yield "clean", at_centre(clean(_PAIRS, 1, _REACH_PX))
    yield "hard", at_centre(hard(_PAIRS, 2, _REACH_PX))
    seen = scenes(_SCENES, 3, _REACH_PX)
    yield "scene", [(s.left, s.right, s.truth.left_px, s.disparity_px) for s in seen]


def _accuracy(condition: str, cases: list[tuple[Image, Image, Point, float]]) -> list[Row]:
    truth = np.array([case[3] for case in cases])
    peers = {
        "OpenCV phaseCorrelate": _best([_errors(_opencv_phase(w), cases) for w in _WINDOWS_PX]),
        "skimage phase_cross_correlation": _best([_errors(_skimage_phase(w), cases) for w in _WINDOWS_PX]),
        "OpenCV StereoSGBM": _best([_errors(_sgbm, cases)]),
    }
    peer = min(peers, key=lambda name: peers[name])
    rows = [Row(f"disparity.peer.{name.split()[-1]}.{condition}", value, "px RMS") for name, value in peers.items()]
    for name in estimator_names():
        estimator = make_estimator(DisparityParameters(estimator=name))
        started = time.perf_counter()
        answers = [estimator.estimate(left, right, point) for left, right, point, _ in cases]
        each_ms = 1e3 * (time.perf_counter() - started) / len(cases)
        errors = np.array([a.horizontal_px for a in answers]) - truth
        confident = np.array([a.confidence > 0.5 for a in answers])
        good = np.abs(errors) <= _WRONG_PX
        rms = _rms(errors[confident])
        rows.append(Row(f"disparity.{name}.{condition}", rms, "px RMS", peer, peers[peer]))
        if name == DisparityParameters().estimator:
            share = float((confident & good).sum() / max(good.sum(), 1))
            rows.append(Row(f"disparity.confident_share.{condition}", share, "of good answers"))
            rows.append(Row(f"disparity.good_share.{condition}", float(good.mean()), "within 2 px"))
            rows.append(
                Row(f"disparity.wrong_share.{condition}", float((confident & ~good).mean()), "confident, wrong")
            )
            normalised = errors[confident] / np.array([a.sigma_px for a in answers])[confident]
            rows.append(Row(f"disparity.sigma.{condition}", _rms(normalised), "error over its sigma, RMS"))
            rows.append(Row(f"disparity.cost_wide.{condition}", each_ms, "ms"))
            started = time.perf_counter()
            for left, right, point, d in cases:
                estimator.estimate(left, right, point, d + 2.0)
            each_ms = 1e3 * (time.perf_counter() - started) / len(cases)
            rows.append(Row(f"disparity.cost_tracking.{condition}", each_ms, "ms"))
    return rows


def _deceived() -> list[Row]:
    estimator = make_estimator(DisparityParameters())
    rng = np.random.default_rng(5)
    false: dict[str, int] = {}
    for k, (kind, pair) in enumerate(deceptive(_DECEPTIVE, 4)):
        # Every other pair with a wrong expected disparity.
        expected_px = None if k % 2 else float(rng.uniform(-100, 100))
        answer = estimator.estimate(pair.left, pair.right, None, expected_px)
        wrong = pair.disparity_px is None or not abs(answer.horizontal_px - pair.disparity_px) <= _WRONG_PX
        false[kind] = false.get(kind, 0) + int(wrong and answer.confidence > 0.5)
    rows = [Row("disparity.false_confident", sum(false.values()), f"of {_DECEPTIVE}")]
    return rows + [Row(f"disparity.false_confident.{kind}", count, "cases") for kind, count in false.items()]


def _rms(errors: NDArray[np.floating]) -> float:
    finite = errors[np.isfinite(errors)]
    return float(np.sqrt(np.mean(finite**2))) if len(finite) else math.nan


def _errors(
    measure: Callable[[Image, Image, Point], float], cases: list[tuple[Image, Image, Point, float]]
) -> NDArray[np.float64]:
    return np.array([measure(left, right, point) - d for left, right, point, d in cases])


def _best(errors: list[NDArray[np.float64]]) -> float:
    return min(_rms(one) for one in errors)


def _window(image: Image, point: Point, side: int) -> NDArray[np.float32]:
    """Cut the whole-pixel window whose centre is nearest to the point; both eyes' are cut at the same place."""
    x, y = (round(c - (side - 1) / 2) for c in point)
    return image[y : y + side, x : x + side].astype(np.float32)


def _opencv_phase(side: int) -> Callable[[Image, Image, Point], float]:
    hann = cv2.createHanningWindow((side, side), cv2.CV_32F)

    def measure(left: Image, right: Image, point: Point) -> float:
        (dx, _), _ = cv2.phaseCorrelate(_window(left, point, side), _window(right, point, side), hann)
        return -float(dx)

    return measure


def _skimage_phase(side: int) -> Callable[[Image, Image, Point], float]:
    hann = cv2.createHanningWindow((side, side), cv2.CV_32F)

    def measure(left: Image, right: Image, point: Point) -> float:
        windows = [_window(image, point, side) for image in (left, right)]
        faded = [(window - window.mean()) * hann for window in windows]
        # The shift that brings the right window onto the left one.
        shift = phase_cross_correlation(faded[0], faded[1], upsample_factor=100)[0]
        return float(shift[1])

    return measure


def _sgbm(left: Image, right: Image, point: Point) -> float:
    """Return the median of what semi-global matching says in the 5x5 pixels about the point, NaN if nothing."""
    matcher = cv2.StereoSGBM_create(-32, 64, 7, 8 * 49, 32 * 49, uniquenessRatio=5)  # type: ignore[attr-defined]
    x, y = (round(c) for c in point)
    near = matcher.compute(left, right)[y - 2 : y + 3, x - 2 : x + 3]
    known = near[near > -33 * 16] / 16.0
    return float(np.median(known)) if known.size else math.nan
