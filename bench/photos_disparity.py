"""The default disparity estimator at points of real pairs whose disparity is known, semi-global matching beside it.

Half of the points are those of the photographs, matched and checked to about half a pixel; the others are drawn from
scikit-image's motorcycle, which was measured by structured light: only those judge the stated deviation.
"""

import math
import time
from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

from bench.photos_data import MOTORCYCLE, KnownPoint, grey_pair, motorcycle_points, pair_names, pair_of, targets
from bench.results import Row
from vergence_metric.disparity import Disparity, make_estimator
from vergence_metric.disparity.parameters import DisparityParameters
from vergence_sim.photo.matching import matched_disparity, semi_global

Array = npt.NDArray[np.float64]

POINTS = 1000
_WRONG_PX = 2.0
_TARGETS_OF_A_PAIR = 24
_PEER = "OpenCV StereoSGBM (HH)"


def known_points(count: int, from_photographs: bool = True) -> list[KnownPoint]:
    """Return `count` points: up to 24 of every photograph, the rest of the motorcycle."""
    found = [
        KnownPoint(name, t.point.x_px, t.point.y_px, t.point.disparity_px, exact=False)
        for name in (pair_names() if from_photographs else ())
        for t in targets(name, min(_TARGETS_OF_A_PAIR, count // 40))
    ]
    return found + motorcycle_points(count - len(found), seed=21)


def rows(points: list[KnownPoint]) -> list[Row]:
    """Return the rows of these points."""
    names = list(dict.fromkeys(point.pair for point in points))
    estimator = make_estimator(DisparityParameters())
    answers: list[tuple[KnownPoint, Disparity, float]] = []
    point_s = frame_s = 0.0
    for name in names:
        left, right = grey_pair(name)
        began = time.perf_counter()
        dense = semi_global(left, right)
        frame_s += time.perf_counter() - began
        for point in (p for p in points if p.pair == name):
            began = time.perf_counter()
            answer = estimator.estimate(left, right, (point.x_px, point.y_px))
            point_s += time.perf_counter() - began
            answers.append((point, answer, _at(dense, point)))
    cost = (point_s / len(answers)) / (frame_s / len(names))
    exact = [answer for answer in answers if answer[0].exact]
    return [
        *_accuracy("", answers),
        *_accuracy(".motorcycle", exact),
        Row("photo.disparity.inside_2sigma", _inside_2sigma(exact), "of the motorcycle's that were answered"),
        Row("photo.disparity.confidence_ranks", _confidence_ranks(answers), "rank correlation with -error"),
        *_matched_rows([point for point in points if point.exact]),
        Row("photo.disparity.cost", cost, f"of a frame of {_PEER}", _PEER, 1.0),
        Row("photo.disparity.point_ms", 1e3 * point_s / len(answers), "ms a point", _PEER, 1e3 * frame_s / len(names)),
    ]


def _accuracy(suffix: str, answers: list[tuple[KnownPoint, Disparity, float]]) -> list[Row]:
    truth = np.array([point.disparity_px for point, _, _ in answers])
    ours = np.array([answer.horizontal_px if answer.ok else math.nan for _, answer, _ in answers]) - truth
    peer = np.array([value for _, _, value in answers]) - truth
    measures = (
        ("over_2px", f"of those answered, {len(answers)} points", _over),
        ("answered", "of all points", lambda errors: float(np.isfinite(errors).mean())),
        ("median_px", "px", lambda errors: float(np.nanmedian(np.abs(errors)))),
    )
    return [Row(f"photo.disparity.{n}{suffix}", m(ours), unit, _PEER, m(peer)) for n, unit, m in measures]


def _matched_rows(points: list[KnownPoint]) -> list[Row]:
    """Return the rows of what the demo compares with before photographs of which nothing was measured."""
    pair = pair_of(MOTORCYCLE)
    dense = matched_disparity(pair.left, pair.right)
    errors = np.array([_at(dense, point) - point.disparity_px for point in points])
    return [
        Row("photo.matched.over_2px", _over(errors), "of those that the demo's matching answers, motorcycle"),
        Row("photo.matched.answered", float(np.isfinite(errors).mean()), "of the motorcycle's points"),
    ]


def _over(errors: Array) -> float:
    known = errors[np.isfinite(errors)]
    return float((np.abs(known) > _WRONG_PX).mean()) if known.size else math.nan


def _inside_2sigma(answers: Iterable[tuple[KnownPoint, Disparity, float]]) -> float:
    inside = [abs(a.horizontal_px - p.disparity_px) <= 2.0 * a.sigma_px for p, a, _ in answers if a.ok]
    return float(np.mean(inside)) if inside else math.nan


def _confidence_ranks(answers: Iterable[tuple[KnownPoint, Disparity, float]]) -> float:
    """Return Spearman's rank correlation of confidence and -error over the points that were answered."""
    answered = [(a.confidence, -abs(a.horizontal_px - p.disparity_px)) for p, a, _ in answers if a.ok]
    confidence, less_error = (_ranks(np.array(values)) for values in zip(*answered, strict=True))
    return float(np.corrcoef(confidence, less_error)[0, 1])


def _ranks(values: Array) -> Array:
    """Return the ranks (n,) of values (n,); equal ones share their mean rank."""
    _, which, counts = np.unique(values, return_inverse=True, return_counts=True)
    last = np.cumsum(counts)
    return np.asarray((last - 0.5 * (counts - 1))[which], np.float64)


def _at(dense: Array, point: KnownPoint) -> float:
    return float(dense[round(point.y_px), round(point.x_px)])
