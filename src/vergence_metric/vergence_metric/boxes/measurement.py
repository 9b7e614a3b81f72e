"""Metric II of pair after pair: detect, associate, choose the target, smooth, measure, refine, triangulate."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vergence_metric.boxes.association import BoxPair, associate
from vergence_metric.boxes.corner_metric import corner_metric, hidden_sides
from vergence_metric.boxes.detections import Box, Detections
from vergence_metric.boxes.detector import Detector
from vergence_metric.boxes.errors import DetectorImageError
from vergence_metric.boxes.motion import MOTION_CLASS, ChangeDetector, outside_of
from vergence_metric.boxes.object_tracks import ObjectTracks
from vergence_metric.boxes.pair_geometry import PairGeometry
from vergence_metric.boxes.parameters import BoxMetricParameters
from vergence_metric.boxes.refinement import refine
from vergence_metric.boxes.result import NAN2, UNREFINED, BoxStatus, BoxVergenceResult
from vergence_metric.boxes.seen_object import ObjectBoxes
from vergence_metric.boxes.smoothing import LagLimitedFilter, smoothed_pair
from vergence_metric.boxes.target_choice import RequestedObject, TargetChoice
from vergence_metric.boxes.target_point import TargetPoint, locate
from vergence_metric.boxes.uncertainty import direction_sigma_px, disparity_sigma_px
from vergence_metric.disparity.angular_disparity import angular_disparity
from vergence_metric.edges.edges import to_grey
from vergence_rig.camera import CameraModel
from vergence_rig.geometry import EyeAngles
from vergence_rig.kinematics import Kinematics
from vergence_rig.rig import default_rig

Models = tuple[CameraModel, CameraModel]

JOINT_SIGMA_RAD = 0.004
"""Standard deviation of the angle of a joint without feedback: a dead band of 0.75 degree, evenly spread."""

_VERTICAL_WEIGHT = 0.05
_LARGEST_VERTICAL_PX = 40.0


class BoxMeasurement:
    """Measures pairs in order of their stamps; keeps the target and the mounts' vertical offset between them."""

    def __init__(
        self,
        parameters: BoxMetricParameters,
        kinematics: Kinematics,
        detector: Detector | None = None,
        threads: int = 1,
    ) -> None:
        """Load the detector that the parameters name, on `threads` threads, unless one is given; raises its errors."""
        self.detector = detector or Detector(parameters.detector, threads)
        self._kinematics = kinematics
        self._tracks = ObjectTracks(parameters.follow)
        self._choice = TargetChoice(parameters.follow, self._tracks, frozenset({MOTION_CLASS}))
        self._motion = ChangeDetector(parameters.motion), ChangeDetector(parameters.motion)
        self._vertical_px, self._vertical_count = 0.0, 0
        self._parameters = parameters
        self._filter = LagLimitedFilter(parameters.measurement.smoothing_lag_s)

    def set_parameters(self, parameters: BoxMetricParameters) -> None:
        """Apply changed parameters; raises ModelClassError for classes the model does not have."""
        if parameters == self._parameters:
            return
        self.detector.set_parameters(parameters.detector)
        self._tracks.parameters = self._choice.parameters = parameters.follow
        for motion in self._motion:
            motion.parameters = parameters.motion
        if parameters.measurement.smoothing_lag_s != self._parameters.measurement.smoothing_lag_s:
            self._filter = LagLimitedFilter(parameters.measurement.smoothing_lag_s)
        self._parameters = parameters

    def request(self, requested: RequestedObject) -> None:
        """Choose the target as requested from the next pair on."""
        self._choice.request(requested)

    def measure(
        self,
        left: NDArray[Any],
        right: NDArray[Any],
        stamp_s: float = 0.0,
        eyes: EyeAngles | None = None,
        models: Models | None = None,
    ) -> BoxVergenceResult:
        """Return metric II of a pair.

        Args:
            left: (h, w, 3) BGR or (h, w) grey uint8 of the left eye.
            right: of the right eye, of the same size.
            stamp_s: of the left image; a stamp that goes back drops the target.
            eyes: joint angles at the images' stamps, None if unknown.
            models: both cameras, None if unknown.

        Raises:
            DetectorImageError: images that are not of one size, or no images.

        """
        if left.shape[:2] != right.shape[:2]:
            raise DetectorImageError(
                f"right image must be of the left one's size {left.shape[:2]}: got {right.shape[:2]}"
            )
        return self.measure_detections(
            (left, right), (self.detector.detect(left), self.detector.detect(right)), stamp_s, eyes, models
        )

    def measure_detections(
        self,
        images: tuple[NDArray[Any], NDArray[Any]],
        seen: tuple[Detections, Detections],
        stamp_s: float,
        eyes: EyeAngles | None,
        models: Models | None,
    ) -> BoxVergenceResult:
        """Return metric II of what was detected in a pair; see `measure`."""
        geometry = PairGeometry(*models, eyes, self._kinematics) if models is not None and eyes is not None else None
        left, right = (self._with_motion(eye, images[eye], seen[eye].boxes(), stamp_s, eyes) for eye in (0, 1))
        found = associate(
            left,
            right,
            self._parameters.association,
            self._vertical_px,
            images,
            geometry,
            self._tracks.expected(self._choice.target_id, stamp_s, geometry),
        )
        objects = self._tracks.update(found, stamp_s, images, geometry)
        choice = self._choice.choose(objects, stamp_s, seen[0].image_size_px)
        result = self._measured(choice.target.boxes if choice.target else None, images, seen, stamp_s, geometry, models)
        return replace(result, target=choice.target, choice_reason=choice.reason, objects=tuple(objects))

    def _with_motion(
        self, eye: int, image: NDArray[Any], boxes: list[Box], stamp_s: float, eyes: EyeAngles | None
    ) -> list[Box]:
        if not self._parameters.motion.enable:
            return boxes
        pose_rad = None if eyes is None else (eyes.pan_right_rad if eye else eyes.pan_left_rad, eyes.tilt_rad)
        return [*boxes, *outside_of(self._motion[eye].detect(image, stamp_s, pose_rad), boxes)]

    def _measured(
        self,
        boxes: ObjectBoxes | None,
        images: tuple[NDArray[Any], NDArray[Any]],
        seen: tuple[Detections, Detections],
        stamp_s: float,
        geometry: PairGeometry | None,
        models: Models | None,
    ) -> BoxVergenceResult:
        if boxes is None or boxes.pair is None:
            self._filter.reset()
            return self._one_eyed(boxes or ObjectBoxes(), seen, models)
        if boxes.pair.ambiguous:
            self._filter.reset()
            only_left = self._one_eyed(ObjectBoxes(left=boxes.left), seen, models)
            return replace(
                only_left,
                right=boxes.right,
                status=BoxStatus.AMBIGUOUS,
                reason="another box of this class fits the target's about as well",
            )
        return self._paired(boxes.pair, images, seen, stamp_s, geometry, models)

    def _one_eyed(
        self, boxes: ObjectBoxes, seen: tuple[Detections, Detections], models: Models | None
    ) -> BoxVergenceResult:
        if boxes.left is not None:
            status, reason = BoxStatus.LEFT_ONLY, "the right eye does not see it"
        elif boxes.right is not None:
            status, reason = BoxStatus.RIGHT_ONLY, "the left eye does not see it"
        else:
            status, reason = BoxStatus.NO_TARGET, "neither eye sees a target"
        return BoxVergenceResult(
            status,
            reason,
            *seen,
            left=boxes.left,
            right=boxes.right,
            left_rad=_angles(models and models[0], boxes.left),
            right_rad=_angles(models and models[1], boxes.right),
        )

    def _paired(
        self,
        pair: BoxPair,
        images: tuple[NDArray[Any], NDArray[Any]],
        seen: tuple[Detections, Detections],
        stamp_s: float,
        geometry: PairGeometry | None,
        models: Models | None,
    ) -> BoxVergenceResult:
        p = self._parameters.measurement
        left, right = self._smoothed(pair, stamp_s)
        refined = refine(to_grey(images[0]), to_grey(images[1]), left, right) if p.refine else UNREFINED
        expected_vertical = self._vertical_px
        if geometry is not None:
            expected_vertical += geometry.vertical_px(left.center_px, right.center_px[0])
        hidden = hidden_sides(left, right, p.occlusion_ratio, refined.horizontal_px, expected_vertical)
        metric = corner_metric(left, right, hidden)
        status, reason = BoxStatus.OK, ""
        if left.is_cut or right.is_cut:
            status, reason = BoxStatus.CUT, "a box is cut by the image's border"
        elif any(hidden):
            status, reason = BoxStatus.OCCLUDED, "the boxes' sizes disagree: partly hidden in one eye"
        else:
            self._update_vertical(float(metric.center_px[1]) - (expected_vertical - self._vertical_px))
        center_px, center_rad = _undistorted(models, left.center_px, (metric.center_px[0], metric.center_px[1]))
        surface_px, _ = _undistorted(models, left.center_px, (refined.horizontal_px, refined.vertical_px))
        source_per_input = seen[0].image_size_px[0] / self.detector.input_px[0]
        sigma_px = disparity_sigma_px(left, right, source_per_input)
        return BoxVergenceResult(
            status,
            reason,
            *seen,
            left=left,
            right=right,
            metric=metric,
            center_px=center_px,
            center_rad=center_rad,
            sigma_px=sigma_px if math.isfinite(center_px[0]) else math.nan,
            refined=replace(refined, horizontal_px=surface_px[0], vertical_px=surface_px[1]),
            left_rad=_angles(models and models[0], left),
            right_rad=_angles(models and models[1], right),
            point=self._located((left, right), metric.center_px, refined, sigma_px, source_per_input, geometry),
        )

    def _located(
        self,
        boxes: tuple[Box, Box],
        center_px: NDArray[np.float64],
        refined: Any,
        sigma_px: float,
        source_per_input: float,
        geometry: PairGeometry | None,
    ) -> TargetPoint | None:
        if geometry is None:
            return None
        left, right = boxes
        disparity = (refined.horizontal_px, refined.vertical_px)
        sigma = refined.sigma_px
        if not math.isfinite(disparity[0]):
            landmarks = bool(left.landmarks_px and right.landmarks_px)
            disparity = tuple(np.subtract(left.point_px, right.point_px) if landmarks else center_px)
            sigma = sigma_px
        if not all(math.isfinite(value) for value in disparity):
            return None
        x, y = left.point_px
        right_px = x - float(disparity[0]), y - float(disparity[1])
        sigmas = (direction_sigma_px(left, source_per_input), sigma, JOINT_SIGMA_RAD)
        return locate((x, y), right_px, (geometry.left, geometry.right), geometry.eyes, self._kinematics, sigmas)

    def _smoothed(self, pair: BoxPair, stamp_s: float) -> tuple[Box, Box]:
        if self._parameters.measurement.smoothing_lag_s == 0.0:
            return pair.left, pair.right
        return smoothed_pair(self._filter, stamp_s, pair.left, pair.right)

    def _update_vertical(self, offset_px: float) -> None:
        """Update the mounts' vertical offset by a complete pair: the mean of the first ones, then a slow low pass."""
        if not math.isfinite(offset_px):
            return
        self._vertical_count += 1
        weight = max(_VERTICAL_WEIGHT, 1.0 / self._vertical_count)
        updated = self._vertical_px + weight * (offset_px - self._vertical_px)
        self._vertical_px = min(max(updated, -_LARGEST_VERTICAL_PX), _LARGEST_VERTICAL_PX)


def measure_pair(
    left_bgr: NDArray[Any],
    right_bgr: NDArray[Any],
    model_path: str | Path = "",
    parameters: BoxMetricParameters | None = None,
    models: Models | None = None,
) -> BoxVergenceResult:
    """Return metric II of one pair of images with the detector in `model_path` ("" for the shipped one).

    Raises DetectorError (a ValueError) with one clear line where the model or the images cannot be used.
    """
    chosen = parameters or BoxMetricParameters()
    chosen = replace(chosen, detector=chosen.detector.replaced(model=str(model_path)))
    return BoxMeasurement(chosen, Kinematics(default_rig())).measure(left_bgr, right_bgr, models=models)


def _angles(model: CameraModel | None, box: Box | None) -> tuple[float, float]:
    if model is None or box is None:
        return NAN2
    azimuth, elevation = model.angles([box.point_px])[0]
    return float(azimuth), float(elevation)


def _undistorted(
    models: Models | None, left_px: tuple[float, float], disparity_px: tuple[float, float]
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return a disparity in undistorted pixels and in angle; as it is, and NaN, where the cameras are unknown."""
    horizontal, vertical = float(disparity_px[0]), float(disparity_px[1])
    if models is None:
        return (horizontal, vertical), NAN2
    found = angular_disparity(*models, left_px, horizontal, vertical)
    return (found.horizontal_px, found.vertical_px), (found.horizontal_rad, found.vertical_rad)
