"""Matching inside boxes (Liu et al.) where there is no object that the shipped detector knows: the boxes are given.

A detector's boxes are about a pixel off, in each eye by itself. So are these; what is matched inside them is not.
"""

import math
import time
from dataclasses import dataclass

import numpy as np

from bench.trackers_runs import Run
from bench.trackers_scenes import REQUEST_FRAME, Frame, Pixel
from vergence_metric.boxes import BoxMeasurement
from vergence_metric.boxes.detections import Detections, make_detections
from vergence_metric.boxes.parameters import BoxMetricParameters
from vergence_rig.camera import CameraModel
from vergence_rig.kinematics import Kinematics
from vergence_rig.rig import Rig

_BOX_SIGMA_PX = 1.0  # of each of a box's sides
_SCORE, _NAMES = 0.9, ("piece of a photograph",)


@dataclass(frozen=True)
class GivenBoxes:
    """The run with given boxes; `detected` is the share of pairs in which the shipped detector finds the target itself.

    `centers_px` is the RMS error of the disparity of the boxes' centres, with nothing matched.
    """

    run: Run
    detected: float
    centers_px: float


def run_given_boxes(frames: list[Frame], rig: Rig, seed: int = 0) -> GivenBoxes:
    """Return the run of metric II with a box about the target in both eyes; the detector's own time is in its cost."""
    measurement, rng = BoxMeasurement(BoxMetricParameters(), Kinematics(rig)), np.random.default_rng(seed)
    cameras = CameraModel(rig.left_camera), CameraModel(rig.right_camera)
    places, disparities, centers, spent_s, detected = [], [], [], [], []
    for frame in frames[REQUEST_FRAME:]:
        given = _given(frame, frame.left_px, rng), _given(frame, frame.right_px, rng)
        started = time.process_time()
        found = [measurement.detector.detect(image) for image in frame.colours]
        result = measurement.measure_detections(frame.colours, given, frame.stamp_s, frame.eyes, cameras)
        spent_s.append(time.process_time() - started)
        detected.append(_covers(found[0], frame.left_px) and _covers(found[1], frame.right_px))
        places.append((math.nan, math.nan) if result.left is None else result.left.center_px)
        disparities.append(result.refined.horizontal_px)
        centers.append(result.corners.center_px[0] - (frame.left_px[0] - frame.right_px[0]))
    run = Run(np.array(places), np.array(disparities), 1e3 * float(np.mean(spent_s[1:])))
    return GivenBoxes(run, float(np.mean(detected)), float(np.sqrt(np.nanmean(np.square(centers)))))


def _given(frame: Frame, at_px: Pixel, rng: np.random.Generator) -> Detections:
    height, width = frame.left.shape
    outline = frame.outline_px - frame.left_px + at_px
    sides = np.concatenate([outline.min(axis=0), outline.max(axis=0)]) + _BOX_SIGMA_PX * rng.standard_normal(4)
    return make_detections(sides[None], np.array([_SCORE]), np.array([0]), _NAMES, (width, height))


def _covers(found: Detections, px: Pixel) -> bool:
    return any(
        x_min <= px[0] <= x_max and y_min <= px[1] <= y_max for x_min, y_min, x_max, y_max in found.xyxy_px.tolist()
    )
