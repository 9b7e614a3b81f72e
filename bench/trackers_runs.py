"""One tracker through one sequence: where it says the target is, pair by pair, and at what cost of CPU time."""

import math
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bench.trackers_scenes import REQUEST_FRAME, Frame
from vergence_metric.boxes import BoxMeasurement
from vergence_metric.boxes.parameters import BoxMetricParameters
from vergence_metric.disparity import make_estimator
from vergence_metric.disparity.parameters import DisparityParameters
from vergence_metric.disparity.shared_estimate import SharedEstimate
from vergence_metric.tracking.anchored_cluster import AnchoredCluster
from vergence_metric.tracking.eye_view import eye_views
from vergence_metric.tracking.locking_tracker import LockingTracker
from vergence_metric.tracking.modelled_follower import Followed, TargetModel
from vergence_metric.tracking.parameters import TrackerParameters
from vergence_metric.tracking.protocol import Tracker
from vergence_metric.tracking.registry import make_tracker
from vergence_metric.tracking.request import StoredPair, TrackRequest
from vergence_rig.camera import CameraModel
from vergence_rig.kinematics import Kinematics
from vergence_rig.rig import Rig

DETECTOR = "detector_roi"
NAIVE = ("corner_centroid", "nearest_corner")
_CLUSTER = "corner_cluster"

OnPair = Callable[[Frame, Tracker], None]


@dataclass(frozen=True)
class Run:
    """What a tracker says of the pairs after the request: `left_px` (N, 2), `disparity_px` (N,), NaN where lost."""

    left_px: NDArray[np.float64]
    disparity_px: NDArray[np.float64]
    cpu_ms: float


def run_tracker(
    kind: str, frames: list[Frame], rig: Rig, on_pair: OnPair | None = None, repeats: int = 1
) -> tuple[Run, dict[str, Run]]:
    """Return the run of a kind of tracker, and of the naive fixations of its corners if it has any.

    `on_pair` is called after each pair with it and the tracker, outside the time that is measured. Other processes
    make a pair's CPU time longer, never shorter: of `repeats` runs the least counts.
    """
    run, others, spent_s = _run_once(kind, frames, rig, on_pair)
    again = [_run_once(kind, frames, rig, None)[2] for _ in range(repeats - 1)]
    cpu_ms = 1e3 * float(np.min([spent_s, *again], axis=0).mean())
    return replace(run, cpu_ms=cpu_ms), {name: replace(other, cpu_ms=cpu_ms) for name, other in others.items()}


def _run_once(
    kind: str, frames: list[Frame], rig: Rig, on_pair: OnPair | None
) -> tuple[Run, dict[str, Run], list[float]]:
    """Return what `run_tracker` returns, without costs, and the CPU time of each pair after the request [s]."""
    camera, kinematics, parameters = CameraModel(rig.left_camera), Kinematics(rig), DisparityParameters()
    estimator = SharedEstimate(make_estimator(parameters), parameters)
    tracker: Tracker = make_tracker(TrackerParameters(kind=kind), estimator, camera, kinematics)
    places, disparities, naive, spent_s = [], [], _NaiveFixations(), []
    for number, frame in enumerate(frames):
        started = time.thread_time()
        if number == REQUEST_FRAME:
            tracker.request(TrackRequest(1, frame.stamp_s, True, frame.left_px), stored(frame, camera, kinematics))
        track = tracker.update(frame.left, frame.right, frame.stamp_s, frame.eyes)
        if number > REQUEST_FRAME:
            spent_s.append(time.thread_time() - started)
        if number >= REQUEST_FRAME:
            places.append(track.left_px)
            disparities.append(track.disparity_px)
            if kind == _CLUSTER:
                naive.add(model_of(tracker), frame, math.isfinite(track.left_px[0]))
            if on_pair is not None:
                on_pair(frame, tracker)
    run = Run(np.array(places), np.array(disparities), math.nan)
    others = naive.places if kind == _CLUSTER else {}
    nothing = np.full(len(places), math.nan)
    return run, {name: Run(np.array(px), nothing, math.nan) for name, px in others.items()}, spent_s


def run_detector(frames: list[Frame], rig: Rig) -> Run:
    """Return the run of the shipped detector with matching inside its boxes (Liu et al.); the middle of the box."""
    measurement = BoxMeasurement(BoxMetricParameters(), Kinematics(rig))
    cameras = CameraModel(rig.left_camera), CameraModel(rig.right_camera)
    places, disparities, spent_s = [], [], []
    for frame in frames[REQUEST_FRAME:]:
        started = time.process_time()
        result = measurement.measure(*frame.colours, frame.stamp_s, frame.eyes, cameras)
        spent_s.append(time.process_time() - started)
        box = result.left
        x_min, y_min, x_max, y_max = (math.nan,) * 4 if box is None else box.xyxy_px
        places.append((0.5 * (x_min + x_max), 0.5 * (y_min + y_max)))
        disparities.append(result.refined.horizontal_px)
    return Run(np.array(places), np.array(disparities), 1e3 * float(np.mean(spent_s[1:])))


def model_of(tracker: Tracker) -> TargetModel | None:
    """Return what a tracker has learnt of its target, None where that is no model."""
    return Followed.model_of(tracker.target) if isinstance(tracker, LockingTracker) else None


def stored(frame: Frame, camera: CameraModel, kinematics: Kinematics) -> StoredPair:
    """Return a frame as the pair in which a point is requested."""
    return StoredPair(frame.stamp_s, frame.left, frame.right, eye_views(camera, frame.eyes, kinematics))


class _NaiveFixations:
    """The two fixations that Reid and Murray compare theirs with: the corners' centroid, and the nearest corner."""

    def __init__(self) -> None:
        self.places: dict[str, list[tuple[float, float]]] = {name: [] for name in NAIVE}
        self._corner: int | None = None
        self._last: NDArray[np.float64] | None = None

    def add(self, model: object, frame: Frame, located: bool) -> None:
        """Add where both are in a pair."""
        centroid = nearest = (math.nan, math.nan)
        if isinstance(model, AnchoredCluster) and located and model.corners.visible.any():
            px, ids = model.corners.px[model.corners.visible], model.corners.ids[model.corners.visible]
            centroid = _pair(px.mean(axis=0))
            last = np.array(frame.left_px) if self._last is None else self._last
            if self._corner not in ids:
                self._corner = int(ids[np.linalg.norm(px - last, axis=1).argmin()])
            self._last = px[ids == self._corner][0]
            nearest = _pair(self._last)
        for name, place in zip(NAIVE, (centroid, nearest), strict=True):
            self.places[name].append(place)


def _pair(values: Iterable[float]) -> tuple[float, float]:
    x, y = values
    return float(x), float(y)
