"""All measurements on a pair of images, stage by stage, so that each can be published as soon as it is available."""

import math
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

from numpy.typing import NDArray

from vergence_metric.alignment.alignment import Alignment
from vergence_metric.disparity import Disparity, make_estimator
from vergence_metric.disparity.protocol import Surface
from vergence_metric.disparity.shared_estimate import SharedEstimate
from vergence_metric.measurement.edge_metric import AlignedPair, EdgeMetric, EdgeMetricResult
from vergence_metric.measurement.foveal_vergence import FovealVergenceClassifier
from vergence_metric.measurement.parameters import PairMeasurementParameters
from vergence_metric.tracking.eye_view import EyeView, eye_views
from vergence_metric.tracking.motion.awaited_motion import AwaitedMotion
from vergence_metric.tracking.protocol import Tracker
from vergence_metric.tracking.registry import make_tracker
from vergence_metric.tracking.request import (
    PairMemory,
    RequestedPointError,
    StoredPair,
    TrackRequest,
    check_inside,
)
from vergence_metric.tracking.saccade_detector import StampedEyeAngles
from vergence_metric.tracking.track import Track, TrackStatus
from vergence_rig.camera import CameraModel
from vergence_rig.eye_image import eye_images
from vergence_rig.geometry import EyeAngles
from vergence_rig.kinematics import Kinematics
from vergence_rig.rig import Rig

_SAME_IMAGE_S = 0.1  # a request is for the pair nearest to its stamp, at most this far from it


@dataclass(frozen=True)
class SeenPair:
    """Grey ideal images (h, w) of both eyes, not aligned yet, with the eyes' angles at their stamps."""

    stamp_s: float
    left: NDArray[Any]
    right: NDArray[Any]
    eyes: EyeAngles


class PairMeasurement:
    """Metric I, the fovea's signed disparity and the followed target of successive pairs, in order of their stamps."""

    def __init__(self, parameters: PairMeasurementParameters, rig: Rig) -> None:
        self._kinematics = Kinematics(rig)
        described = eye_images(rig, (CameraModel(rig.left_camera), CameraModel(rig.right_camera)))
        self._rig_camera = described[0].ideal
        self._tracker: Tracker | None = None
        self._camera: CameraModel | None = None
        self._memory = PairMemory(parameters.tracker.memory_s)
        self._requests: deque[tuple[TrackRequest, SeenPair | None]] = deque()
        self._awaited_motion: AwaitedMotion | None = None
        self._ids_used = 0
        self._newest_id = 0
        self.unmet_request = ""
        """Why the newest request could not be passed on to the tracker; empty if it was."""
        self._parameters = p = parameters
        self._metric = EdgeMetric(p.edges, p.contrast, p.alignment)
        self._classifier = FovealVergenceClassifier(p.verged)
        self._estimator = SharedEstimate(make_estimator(p.disparity), p.disparity)

    @property
    def parameters(self) -> PairMeasurementParameters:
        """The parameters in force."""
        return self._parameters

    def set_parameters(self, parameters: PairMeasurementParameters) -> None:
        """Use these from the next pair on; parts with unchanged groups keep their state, the tracker its target."""
        before, self._parameters, p = self._parameters, parameters, parameters
        if (p.edges, p.contrast, p.alignment) != (before.edges, before.contrast, before.alignment):
            self._metric = EdgeMetric(p.edges, p.contrast, p.alignment)
            self._classifier = FovealVergenceClassifier(p.verged)
        if p.verged != before.verged:
            self._classifier = FovealVergenceClassifier(p.verged)
        if p.disparity != before.disparity:
            self._estimator = SharedEstimate(make_estimator(p.disparity), p.disparity)
            self._tracker = None
        if p.tracker != before.tracker:
            self._tracker = None
            self._memory = PairMemory(p.tracker.memory_s)

    def edge(self, left: NDArray[Any], right: NDArray[Any], seen_px: int | None = None) -> EdgeMetricResult:
        """Return metric I of a pair of images of one size; see `EdgeMetric.measure`."""
        return self._metric.measure(left, right, seen_px)

    def update_alignment(self) -> None:
        """Compute the deferred estimate of alignment, if any; to be called once the pair's results are out."""
        self._metric.update_alignment()

    def disparity(self, edge: EdgeMetricResult) -> Disparity:
        """Return the signed disparity at the left image's centre of a pair measured by `edge`."""
        return self._estimator.estimate(edge.left_grey, edge.right_grey)

    def verged(
        self, edge: EdgeMetricResult, error_px: float, confidence: float, surface: Surface | None = None
    ) -> bool:
        """Return whether the eyes are verged, by contrast, signed error, and the result of the last pair.

        `surface` is what lies at the fovea, None where that was not measured.
        """
        camera = self._camera or self._rig_camera
        contrast = edge.target_contrast(surface).contrast
        return self._classifier.update(contrast, math.atan(error_px / camera.fx_px), confidence)

    def request_track(self, request: TrackRequest, seen: SeenPair | None = None) -> None:
        """Let the tracker follow a point, from the next pair on; may be called from another thread.

        `seen` is the pair of the request, where it is none of those that `track` or `remember` were called with.
        """
        self._requests.append((request, seen))

    def remember(
        self,
        left: NDArray[Any],
        right: NDArray[Any],
        stamp_s: float,
        eyes: EyeAngles | None,
        camera: CameraModel | None,
    ) -> None:
        """Keep a pair for requests, and measure nothing in it; arguments as of `edge` and `track`."""
        pair, camera = self._metric.align(left, right), camera or self._rig_camera
        if eyes is not None and (camera.height_px, camera.width_px) == pair.left_grey.shape:
            self._store(pair, stamp_s, eye_views(camera, eyes, self._kinematics))

    def track(
        self,
        edge: EdgeMetricResult,
        stamp_s: float,
        eyes: EyeAngles | None,
        camera: CameraModel | None,
        samples: Iterable[StampedEyeAngles] = (),
        unknown_joints: str = "no joint_states at the image's stamp",
    ) -> Track:
        """Return the track of the target in a pair measured by `edge`.

        Args:
            edge: the pair.
            stamp_s: of the left image.
            eyes: joint angles at the images' stamps, None if there are none.
            camera: the ideal one of both images; None uses that of the rig, if it is for images of this size.
            samples: joint angles since the pair before, in order of their stamps [s].
            unknown_joints: why `eyes` is None, if it is.
        """
        height, width = edge.left_grey.shape
        camera = camera or self._rig_camera
        if (camera.width_px, camera.height_px) != (width, height):
            return self._unlocked(f"no calibration for {width}x{height} images")
        if eyes is None:
            return self._unlocked(unknown_joints)
        if self._tracker is None or self._camera is None or not camera.equals(self._camera):
            self._camera, self._ids_used = camera, self._newest_id
            self._tracker = make_tracker(self._parameters.tracker, self._estimator, camera, self._kinematics)
        self._pass_on_requests(self._tracker, edge, camera)
        pair = self._store(edge, stamp_s, eye_views(camera, eyes, self._kinematics))
        if self._awaited_motion is not None:
            found = self._awaited_motion.update(pair)
            if isinstance(found, str):
                waiting = Track.nowhere(self._newest_id, TrackStatus.LOST, f"waiting for something that moves: {found}")
                return replace(waiting, goal_id=self._awaited_motion.goal_id)
            self._awaited_motion = None
            self._tracker.request(found, pair)
        track = self._tracker.update(edge.left_grey, edge.right_grey, stamp_s, eyes, samples)
        self._newest_id = self._ids_used + track.track_id
        return replace(track, track_id=self._newest_id)

    def _store(
        self, pair: AlignedPair | EdgeMetricResult, stamp_s: float, views: tuple[EyeView, EyeView]
    ) -> StoredPair:
        stored = StoredPair(stamp_s, pair.left_grey, pair.right_grey, views)
        self._memory.add(stored)
        return stored

    def _stored(
        self, request: TrackRequest, seen: SeenPair | None, camera: CameraModel, by: Alignment
    ) -> StoredPair | None:
        """Return the pair of a request, None if it is not known."""
        if seen is None or (camera.height_px, camera.width_px) != seen.left.shape:
            return self._memory.nearest(request.stamp_s, _SAME_IMAGE_S)
        if abs(seen.stamp_s - request.stamp_s) > _SAME_IMAGE_S:
            return None
        return StoredPair(seen.stamp_s, seen.left, by.apply(seen.right), eye_views(camera, seen.eyes, self._kinematics))

    def _pass_on_requests(self, tracker: Tracker, edge: EdgeMetricResult, camera: CameraModel) -> None:
        while self._requests:
            (request, seen), self.unmet_request = self._requests.popleft(), ""
            self._awaited_motion = AwaitedMotion(request.goal_id) if request.motion else None
            if request.motion:
                continue
            if not request.goal_id:
                tracker.lock_here()
                continue
            if not request.left_eye:
                height, width = edge.right_grey.shape
                request = replace(request, pixel=edge.alignment.aligned(*request.pixel, width, height))
            pair = self._stored(request, seen, camera, edge.alignment)
            if pair is None:
                self.unmet_request = f"no pair is stored for goal {request.goal_id}, stamp {request.stamp_s:.3f} s"
                continue
            try:
                check_inside(request.pixel, pair.left)
                tracker.request(request, pair)
            except RequestedPointError as error:
                self.unmet_request = f"the point of goal {request.goal_id}: {error}"

    def _unlocked(self, reason: str) -> Track:
        return Track.nowhere(self._newest_id, TrackStatus.UNLOCKED, reason)
