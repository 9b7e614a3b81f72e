"""Metric II on the simulator against its ground truth, and the rates of the whole graph.

Pairs are 640x480 with the simulator's noise, exposure and mounts, without lens distortion, so that boxes compare.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from bench.box_rates import measure_rates
from bench.results import Row
from training.average_precision import iou_matrix
from training.scenes import Stage
from vergence_metric.boxes import BoxMeasurement, BoxStatus, BoxVergenceResult
from vergence_metric.boxes.association import associate
from vergence_metric.boxes.pair_geometry import PairGeometry
from vergence_metric.boxes.parameters import BoxMetricParameters
from vergence_rig.camera import CameraModel
from vergence_rig.geometry import EyeAngles, from_version_vergence
from vergence_rig.kinematics import Kinematics
from vergence_rig.rig import default_rig
from vergence_rig.testing.ideal_eyes import gaze_for_point
from vergence_sim.heads import rolled_head
from vergence_sim.parameters import SimParameters
from vergence_sim.simulator import Simulator, StereoFrame
from vergence_sim.truth import TrueBox

WORLDS = range(970_000, 970_006)
VIEWS = 60
ALIKE_SEEDS = range(980_000, 980_010)
ALIKE_VIEWS = 100
_SURFACE_RAYS = 24  # per side and eye; with the 6 of the live ground truth its own error would be 0.2 px
_POINT_95 = 7.815  # of chi squared, three degrees of freedom


@dataclass(frozen=True)
class Case:
    """One pair, the joints, its ground truth and the result of metric II."""

    frame: StereoFrame
    left: TrueBox | None
    right: TrueBox | None
    surface_px: float
    result: BoxVergenceResult

    @property
    def whole(self) -> bool:
        """True if both eyes see all of the target."""
        boxes = (self.left, self.right)
        uncut = all(b is not None and not (b.cut_left or b.cut_top or b.cut_right or b.cut_bottom) for b in boxes)
        truth = self.frame.truth
        return uncut and min(truth.left_visible_share, truth.right_visible_share) > 0.99

    @property
    def seen_by_both(self) -> bool:
        """True if both eyes see at least half of the target, and at least half of it lies in their images."""
        truth = self.frame.truth
        return (
            self.left is not None
            and self.right is not None
            and min(truth.left_visible_share, truth.right_visible_share) >= 0.5
        )


def run(say: Callable[[str], None]) -> list[Row]:
    """Measure against truth, then the rates of the whole graph."""
    cases = list(_cases(say))
    whole = [c for c in cases if c.whole and c.result.status is BoxStatus.OK]
    say(f"{len(whole)} of {len(cases)} pairs show all of the target to both eyes and were measured")
    corners = np.array([c.result.corners.left_minus_right_px - _true_corners(c) for c in whole])
    centers = np.array([c.result.center_px[0] - _true_corners(c)[[0, 2]].mean() for c in whole])
    refined = np.array([c.result.refined.horizontal_px - c.surface_px for c in whole])
    plain = np.array([c.result.center_px[0] - c.surface_px for c in whole])
    say(f"refined: median {np.nanmedian(np.abs(refined)):.3f} px, {np.isnan(refined).mean():.1%} not refined")
    calibrated = centers / np.array([c.result.sigma_px for c in whole])
    both = [c for c in cases if c.seen_by_both]
    paired = [c for c in both if _right_pair(c)]
    for case in both:
        if not _right_pair(case):
            say(f"not paired: {case.result.status.name} ({case.result.reason})")
    wrong, pairs = _wrong_pairs(say)
    boxes_hz, edge_hz = measure_rates(say)
    return [
        Row("box.corner_rms_px", _rms(corners), "px"),
        Row("box.center_rms_px.plain", _rms(centers), "px"),
        Row("box.center_rms_px.refined", _rms(refined), "px", "centres against the surface", _rms(plain)),
        Row("box.sigma_ratio", _rms(calibrated), "error / stated sigma"),
        Row("box.refined_share", float(np.isfinite(refined).mean()), "share of the pairs"),
        Row("box.point_inside_95", _inside_95(whole), "share of target points, 0.95 if honest"),
        Row("box.paired_share", len(paired) / len(both), "share"),
        Row("box.wrong_pairs", float(wrong), f"of {pairs} pairs in {len(ALIKE_SEEDS) * ALIKE_VIEWS} views"),
        Row("box.pairs_per_second", boxes_hz, "Hz"),
        Row("box.edge_pairs_per_second", edge_hz, "Hz, beside it"),
    ]


def _cases(say: Callable[[str], None]) -> Iterator[Case]:
    rig = default_rig()
    cameras = CameraModel(rig.left_camera), CameraModel(rig.right_camera)
    for seed in WORLDS:
        rng = np.random.default_rng(seed)
        simulator = Simulator(
            SimParameters.of({"world.seed": seed, "seed": seed, "servo": "ideal"}),
            rig,
            head=replace(rolled_head(rig), left_camera=rig.left_camera, right_camera=rig.right_camera),
        )
        measurement = BoxMeasurement(BoxMetricParameters(), Kinematics(rig))
        for number in range(VIEWS):
            distance = float(np.exp(rng.uniform(math.log(0.25), math.log(1.4))))
            point = distance * np.array([1.0, rng.uniform(-0.5, 0.5), rng.uniform(-0.35, 0.35)])
            simulator.place_target("cube", point)
            eyes = _near(gaze_for_point(point, rig.baseline_m), rng)
            simulator.set_head(eyes.as_dict())
            frame = simulator.capture()
            left, right = (_cube(simulator.true_boxes(eye)) for eye in ("left", "right"))
            # Far enough apart in time for the pairs to be independent.
            result = measurement.measure(frame.left, frame.right, 100.0 * number, eyes, cameras)
            yield Case(frame, left, right, simulator.mean_disparity_px(_SURFACE_RAYS), result)
        simulator.close()
        say(f"world {seed} measured")


def _near(eyes: EyeAngles, rng: np.random.Generator) -> EyeAngles:
    version, tilt = eyes.version_rad + rng.uniform(-0.35, 0.35), eyes.tilt_rad + rng.uniform(-0.25, 0.25)
    return from_version_vergence(version, max(eyes.vergence_rad + rng.uniform(-0.12, 0.12), 0.0), tilt)


def _cube(boxes: list[TrueBox]) -> TrueBox | None:
    return next((box for box in boxes if box.name == "cube"), None)


def _xyxy(box: TrueBox) -> np.ndarray:
    return np.array([box.x_min_px, box.y_min_px, box.x_max_px, box.y_max_px])


def _true_corners(case: Case) -> np.ndarray:
    assert case.left is not None
    assert case.right is not None
    return _xyxy(case.left) - _xyxy(case.right)


def _inside_95(cases: list[Case]) -> float:
    """Return the share of target points whose error lies within the ellipsoid that should hold 95 % of them."""
    inside = []
    for case in cases:
        if case.result.point is not None:
            off = case.result.point.point_m - case.frame.truth.target_point_m
            inside.append(off @ np.linalg.solve(case.result.point.covariance_m2, off) <= _POINT_95)
    return float(np.mean(inside)) if inside else math.nan


def _right_pair(case: Case) -> bool:
    result = case.result
    if result.metric is None or result.left is None or result.right is None:
        return False
    assert case.left is not None
    assert case.right is not None
    overlaps = (
        iou_matrix(np.array([box.xyxy_px]), _xyxy(true)[None])[0, 0]
        for box, true in ((result.left, case.left), (result.right, case.right))
    )
    return min(overlaps) > 0.3


def _wrong_pairs(say: Callable[[str], None]) -> tuple[int, int]:
    """Count pairs, not called ambiguous, whose boxes are two different cubes."""
    rig = default_rig()
    cameras = CameraModel(rig.left_camera), CameraModel(rig.right_camera)
    parameters = BoxMetricParameters()
    detector = BoxMeasurement(parameters, Kinematics(rig)).detector
    wrong = pairs = ambiguous = 0
    for seed in ALIKE_SEEDS:
        stage = Stage(seed)
        for view in stage.stereo_views(ALIKE_VIEWS, 2 + seed % 2):
            left, right = (detector.detect(image) for image in view.images)
            geometry = PairGeometry(*cameras, EyeAngles(*view.angles_rad), Kinematics(rig))
            found = associate(left.boxes(), right.boxes(), parameters.association, 0.0, view.images, geometry)
            for pair in found.pairs:
                owners = [
                    _owner(box.xyxy_px, boxes)
                    for box, boxes in zip((pair.left, pair.right), view.boxes_px, strict=True)
                ]
                if None in owners:
                    continue  # a false detection or a hardly visible cube: measured by other rows
                pairs, ambiguous = pairs + 1, ambiguous + pair.ambiguous
                wrong += owners[0] != owners[1] and not pair.ambiguous
        stage.close()
        say(f"{pairs} pairs of alike cubes, {wrong} wrong, {ambiguous} called ambiguous")
    return wrong, pairs


def _owner(xyxy: tuple[float, ...], boxes: dict[int, np.ndarray]) -> int | None:
    if not boxes:
        return None
    numbers = list(boxes)
    overlaps = iou_matrix(np.array([xyxy]), np.array([boxes[n] for n in numbers]))[0]
    return numbers[int(overlaps.argmax())] if overlaps.max() > 0.4 else None


def _rms(values: np.ndarray) -> float:
    finite = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(finite**2))) if finite.size else math.nan
