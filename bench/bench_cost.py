"""CPU time of a pair in the metric's core on photographs, without ROS: edges, contrast, disparity, track, alignment.

In the loop the controller subscribes to `vergence/track` alone: the contrast of the small windows, the target's
disparity and its track are computed. `.everything`: also the fovea's disparity and all arrays of `vergence/edge`.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from bench.cost_photographs import Glance, glances, models
from bench.photos_data import NoPhotographsError
from bench.results import Row
from vergence_common.blas_threads import limit_blas_threads
from vergence_common.memory import keep_large_blocks
from vergence_metric.measurement.edge_metric import EdgeMetricResult
from vergence_metric.measurement.pair_measurement import PairMeasurement
from vergence_metric.measurement.parameters import PairMeasurementParameters
from vergence_metric.tracking.request import TrackRequest
from vergence_rig.rig import default_rig

PHOTOGRAPHS = 12
SETTLED = 12  # pairs until the tracker has locked
PAIRS = SETTLED + 15  # as many are measured as there are from one estimate of the alignment to the next
REQUESTED_AT = 2  # the pair after which a point is asked for
STAGES = ("edge", "fovea", "track", "align")
_BESIDE_PX = (4.0, -3.0)  # of a requested point from the fovea: inside the dead band of the servos
_FRAME_S = 1.0 / 30.0
_FIELDS = (
    "left_to_right_px",
    "chance_left_to_right_px",
    "contrast",
    "robust_left_to_right_px",
)


@dataclass(frozen=True)
class Case:
    """What is computed of a pair: `everything` or what the loop needs; of a requested point or what is at the fovea."""

    name: str
    requested: bool
    everything: bool


CASES = (Case("", True, False), Case(".locked", False, False), Case(".everything", True, True))


def run(say: Callable[[str], None]) -> list[Row]:
    """Measure every photograph, verged and with parallel eyes, on one thread."""
    try:
        seen = glances(PHOTOGRAPHS, PAIRS)
    except NoPhotographsError as error:
        say(f"skipped: {error}")
        return []
    keep_large_blocks()  # as every node does, like the next
    limit_blas_threads()
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    rows = []
    try:
        for case in CASES:
            stages = np.array([_stages_ms(one, case) for one in seen])
            verged = np.array([one.verged for one in seen])
            name = f"cost.pair_ms.photo{case.name}"
            rows.append(Row(name, float(stages.sum(axis=1).mean()), "ms CPU"))
            rows.append(Row(f"{name}.verged", float(stages[verged].sum(axis=1).mean()), "ms CPU"))
            rows.append(Row(f"{name}.parallel", float(stages[~verged].sum(axis=1).mean()), "ms CPU"))
            figures = zip(STAGES, stages.mean(axis=0).tolist(), strict=True)
            say(f"{name}: " + ", ".join(f"{stage} {value:.1f}" for stage, value in figures) + " ms")
    finally:
        cv2.setNumThreads(threads)
    return rows


def _stages_ms(glance: Glance, case: Case) -> tuple[float, ...]:
    """Return the CPU time of each stage of a pair [ms], the mean over the pairs with a locked tracker."""
    measurement, camera = PairMeasurement(PairMeasurementParameters(), default_rig()), models()[0]
    spent_ms = []
    for number, (left, right) in enumerate(glance.pairs):
        stamp_s = 100.0 + number * _FRAME_S
        marks = [time.process_time()]
        edge = measurement.edge(left, right)
        if case.everything:
            _read(edge)
        marks.append(time.process_time())
        if case.everything:
            disparity = measurement.disparity(edge)
            measurement.verged(edge, disparity.horizontal_px, disparity.confidence, disparity.surface)
        marks.append(time.process_time())
        measurement.track(edge, stamp_s, glance.eyes, camera)
        marks.append(time.process_time())
        measurement.update_alignment()
        marks.append(time.process_time())
        if case.requested and number == REQUESTED_AT:
            height, width = left.shape[:2]
            pixel = 0.5 * (width - 1) + _BESIDE_PX[0], 0.5 * (height - 1) + _BESIDE_PX[1]
            measurement.request_track(TrackRequest(1, stamp_s, True, pixel))
        if number >= SETTLED:
            spent_ms.append(1e3 * np.diff(marks))
    return tuple(float(value) for value in np.mean(spent_ms, axis=0))


def _read(edge: EdgeMetricResult) -> None:
    for name in _FIELDS:
        getattr(edge, name)
