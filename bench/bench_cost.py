"""CPU time of a pair in the metric's core on photographs: edges, contrast, disparity and track, without ROS."""

import time
from collections.abc import Callable

import cv2
import numpy as np

from bench.cost_photographs import Glance, glances, models
from bench.photos_data import NoPhotographsError
from bench.results import Row
from vergence_common.memory import keep_large_blocks
from vergence_metric.disparity.angular_disparity import angular_disparity
from vergence_metric.measurement.pair_measurement import PairMeasurement
from vergence_metric.measurement.parameters import PairMeasurementParameters
from vergence_rig.rig import default_rig

PHOTOGRAPHS = 12
PAIRS = 24
SETTLED = 12  # pairs until the tracker has locked
STAGES = ("edge", "disparity", "track", "align")
_FRAME_S = 1.0 / 30.0


def run(say: Callable[[str], None]) -> list[Row]:
    """Measure every photograph, verged and not, on one thread."""
    try:
        seen = glances(PHOTOGRAPHS, PAIRS)
    except NoPhotographsError as error:
        say(f"skipped: {error}")
        return []
    keep_large_blocks()  # as every node does
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        stages_ms = {(one.name, one.verged): _stages_ms(one) for one in seen}
    finally:
        cv2.setNumThreads(threads)
    for (name, verged), stages in stages_ms.items():
        text = ", ".join(f"{stage} {value:.1f}" for stage, value in zip(STAGES, stages, strict=True))
        say(f"{name} {'verged' if verged else 'parallel'}: {text} ms")
    rows = [Row("cost.pair_ms.photo", float(np.mean([sum(stages) for stages in stages_ms.values()])), "ms CPU")]
    for verged, word in ((True, "verged"), (False, "parallel")):
        own = np.array([stages for (_, v), stages in stages_ms.items() if v is verged])
        rows.append(Row(f"cost.pair_ms.photo.{word}", float(own.sum(axis=1).mean()), "ms CPU"))
        rows += [
            Row(f"cost.{stage}_ms.photo.{word}", float(own[:, i].mean()), "ms CPU") for i, stage in enumerate(STAGES)
        ]
    return rows


def _stages_ms(glance: Glance) -> tuple[float, ...]:
    """Return the CPU time of each stage of a pair [ms], the mean over the pairs with a locked tracker."""
    measurement, cameras = PairMeasurement(PairMeasurementParameters(), default_rig()), models()
    spent_ms = []
    for number, (left, right) in enumerate(glance.pairs):
        marks = [time.process_time()]
        edge = measurement.edge(left, right)
        marks.append(time.process_time())
        disparity = measurement.disparity(edge)
        angular = angular_disparity(*cameras, disparity.point_px, disparity.horizontal_px, disparity.vertical_px)
        measurement.verged(edge, angular.horizontal_px, disparity.confidence)
        marks.append(time.process_time())
        measurement.track(edge, 100.0 + number * _FRAME_S, glance.eyes, cameras)
        marks.append(time.process_time())
        measurement.update_alignment()
        marks.append(time.process_time())
        if number >= SETTLED:
            spent_ms.append(1e3 * np.diff(marks))
    return tuple(float(value) for value in np.mean(spent_ms, axis=0))
