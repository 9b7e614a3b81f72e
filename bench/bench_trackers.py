"""Trackers side by side: remembered patch, corner cluster, moving target, zero disparity, and a detector's boxes.

Everything is driven by the true image positions: all see the same sequences. Costs are CPU time.
"""

import math
import os
from collections.abc import Callable, Iterable

import cv2
import numpy as np

from bench.results import Row, figure_text
from bench.results import table as plain_table
from bench.trackers_boxes import GivenBoxes, run_given_boxes
from bench.trackers_cepstrum import cepstrum_rows
from bench.trackers_motion import motion_rows
from bench.trackers_pasted import moving_pieces
from bench.trackers_photographs import NoPhotographsError, photograph_rig, sequences
from bench.trackers_runs import DETECTOR, NAIVE, Run, run_detector, run_tracker
from bench.trackers_scenes import SCENES, THINGS, Frame, rig, sequence
from bench.trackers_scores import Score, score, step_px
from vergence_common.blas_threads import limit_blas_threads
from vergence_metric.tracking.parameters import TrackerParameters
from vergence_metric.tracking.registry import tracker_names

_DEFAULT = TrackerParameters().kind
_REPEATS = {"corner_cluster": 2, _DEFAULT: 2}  # of those whose cost is compared with a goal
_BEFORE_HALF, _AFTER_HALF = range(4, 14), range(55, 75)  # pairs of the scene half_hidden
_COLUMNS = ("rms_px", "drift_px", "lost", "false_locks", "reacquired_s", "ms")
_PREFIX = "tracker."

Say = Callable[[str], None]
Scores = dict[tuple[str, str], Score]


def run(say: Say) -> list[Row]:
    """Measure; each kind's row has the default's beside it."""
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    limit_blas_threads(1)  # a second thread would only wait, and its waiting counts as CPU time
    try:
        scores, steps = _rendered(say)
        rows = _rows(scores) + _goals(scores, steps)
        try:
            rows += _photographs(say)
        except NoPhotographsError as error:
            say(str(error))
        rows += motion_rows(say)
        return rows + cepstrum_rows(say)
    finally:
        cv2.setNumThreads(threads)
        limit_blas_threads(os.cpu_count() or 1)


def table(rows: Iterable[Row]) -> str:
    """Return a line for each kind in each scene, then the other rows."""
    lines, others = dict[str, dict[str, float | None]](), []
    for row in rows:
        place, _, column = row.what.rpartition(".")
        if column in _COLUMNS and place.count(".") >= 2:
            lines.setdefault(place.removeprefix(_PREFIX), {})[column] = row.value
        else:
            others.append(row)
    heads = ("kind.scene", *_COLUMNS)
    cells = [heads, *((name, *(figure_text(line.get(c)) for c in _COLUMNS)) for name, line in lines.items())]
    widths = [max(len(line[i]) for line in cells) for i in range(len(heads))]
    shown = "\n".join("  ".join(c.ljust(w) for c, w in zip(line, widths, strict=True)).rstrip() for line in cells)
    return f"{shown}\n\n{plain_table(others)}"


def _rendered(say: Say) -> tuple[Scores, dict[tuple[str, str], float]]:
    scores, steps, head = Scores(), dict[tuple[str, str], float](), rig()
    for scene in SCENES:
        for thing in THINGS:
            frames = list(sequence(scene, thing))
            runs = _runs(frames)
            if thing == "cube":
                runs[DETECTOR] = run_detector(frames, head)
            for kind, one in runs.items():
                scores[kind, f"{scene.name}.{thing}"] = score(frames, one)
                if scene.name == "half_hidden":
                    steps[kind, thing] = step_px(frames, one, _BEFORE_HALF, _AFTER_HALF)
            say(f"{scene.name}, {thing}: {len(frames)} pairs, {len(runs)} trackers")
    return scores, steps


def _runs(frames: list[Frame]) -> dict[str, Run]:
    head, runs = rig(), dict[str, Run]()
    for kind in tracker_names():
        runs[kind], naive = run_tracker(kind, frames, head, repeats=_REPEATS.get(kind, 1))
        runs |= naive
    return runs


def _photographs(say: Say) -> list[Row]:
    """Return rows of what rests in the photographs, and of pieces of them that move across others.

    The means over all sequences, the median errors, the sum of the false locks.
    """
    head, rows = photograph_rig(), list[Row]()
    for scene, found in (("photographs", sequences()), ("photographs_20_deg_s", moving_pieces(follow=True))):
        every, boxes = dict[str, list[Score]](), list[GivenBoxes]()
        for number, (name, frames) in enumerate(found):
            for kind in tracker_names():
                one, _ = run_tracker(kind, frames, head, repeats=_REPEATS.get(kind, 1))
                every.setdefault(kind, []).append(score(frames, one))
            boxes.append(run_given_boxes(frames, head, number))
            every.setdefault(DETECTOR, []).append(score(frames, boxes[-1].run))
            say(f"{scene}: {name}")
        scores = {(kind, scene): _together(each) for kind, each in every.items()}
        rows += _rows(scores)
        detected, centers_px = (
            float(np.mean([b.detected for b in boxes])),
            float(np.median([b.centers_px for b in boxes])),
        )
        matched = Row(
            f"{_PREFIX}{DETECTOR}.{scene}.disparity_px",
            scores[DETECTOR, scene].disparity_px,
            "px RMS",
            "centres of the boxes",
            centers_px,
        )
        rows += [matched, Row(f"{_PREFIX}{DETECTOR}.{scene}.detected", detected, "of pairs, by the shipped detector")]
    return rows


def _together(scores: list[Score]) -> Score:
    def middle(values: Iterable[float]) -> float:
        finite = [value for value in values if math.isfinite(value)]
        return float(np.median(finite)) if finite else math.nan

    return Score(
        middle(s.rms_px for s in scores),
        middle(s.drift_px for s in scores),
        middle(s.jitter_px for s in scores),
        float(np.mean([s.lost for s in scores])),
        float(sum(s.false_locks for s in scores)),
        math.nan,
        middle(s.disparity_px for s in scores),
        float(np.mean([s.ms for s in scores])),
    )


def _rows(scores: Scores) -> list[Row]:
    rows = []
    for (kind, scene), found in scores.items():
        peer = scores.get((_DEFAULT, scene))
        beside = {name: value for name, value, _ in peer.items()} if peer is not None and kind != _DEFAULT else {}
        for name, value, unit in found.items():
            against = (_DEFAULT, beside[name]) if beside else (None, None)
            rows.append(Row(f"{_PREFIX}{kind}.{scene}.{name}", value, unit, *against))
    return rows


def _goals(scores: Scores, steps: dict[tuple[str, str], float]) -> list[Row]:
    """Return the worst of the three things, for the corner cluster and what it is compared with."""
    rows, kinds = [], ("corner_cluster", *NAIVE, "remembered_patch", "zero_disparity")
    for kind in kinds:
        jitter = max(scores[kind, f"rest.{thing}"].jitter_px for thing in THINGS)
        drift = max(scores[kind, f"turning.{thing}"].drift_px for thing in THINGS)
        rows.append(Row(f"{_PREFIX}{kind}.rest_jitter_px", jitter, "px RMS, worst thing"))
        rows.append(Row(f"{_PREFIX}{kind}.turning_drift_px", drift, "px, worst thing"))
        step = max(steps[kind, thing] for thing in THINGS)
        rows.append(Row(f"{_PREFIX}{kind}.half_hidden_step_px", step, "px, worst thing"))
    cost = max(found.ms for (kind, _), found in scores.items() if kind == "corner_cluster")
    return [*rows, Row(f"{_PREFIX}corner_cluster.most_ms", cost, "ms of CPU a pair, most costly scene")]
