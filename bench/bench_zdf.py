"""The zero-disparity filter: distance of its region's centroid from the true target, and its cost."""

import time
from collections.abc import Callable

import cv2
import numpy as np

from bench.disparity_scenes import scenes
from bench.results import Row
from vergence_metric.tracking.zero_disparity import zero_disparity

_SCENES = 80
_MISVERGED_PX = 0.5  # as good as the vergence of a head that fixates
_NEAR_M = 0.5  # nearer, the cube's front is seen under such an angle that its surface is not at one disparity


def run(say: Callable[[str], None]) -> list[Row]:
    """Measure at vergence on the cube in the simulator's room; the target point is the truth."""
    say(f"{_SCENES} scenes at vergence, {_NEAR_M} to 2 m")
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    distances, found, spent_s = [], 0, 0.0
    try:
        for scene in scenes(_SCENES, 7, _MISVERGED_PX, near_m=_NEAR_M):
            started = time.perf_counter()
            region = zero_disparity(scene.left, scene.right, tolerance_px=1 if scene.distance_m > 0.8 else 3)
            spent_s += time.perf_counter() - started
            found += region.found
            if region.found:
                distances.append(np.hypot(*np.subtract(region.centroid_px, scene.truth.left_px)))
    finally:
        cv2.setNumThreads(threads)
    errors = np.array(distances)
    return [
        Row("zdf.center_px", float(np.sqrt(np.mean(errors**2))), "px RMS"),
        Row("zdf.center_median_px", float(np.median(errors)), "px"),
        Row("zdf.center_p95_px", float(np.quantile(errors, 0.95)), "px"),
        Row("zdf.found_share", found / _SCENES, "of scenes"),
        Row("zdf.cost_ms", 1e3 * spent_s / _SCENES, "ms"),
    ]
