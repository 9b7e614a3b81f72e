"""All that is measured on a pair of images, stage by stage, so that each can be published as soon as it is known."""

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from numpy.typing import NDArray

from vergence_metric.disparity import Disparity, make_estimator
from vergence_metric.disparity.parameters import DisparityParameters, TrackerParameters
from vergence_metric.edges.parameters import EdgeMetricParameters
from vergence_metric.measurement.edge_metric import EdgeMetric, EdgeMetricResult
from vergence_metric.measurement.parameters import EdgeMetricNodeParameters
from vergence_metric.measurement.verged import VergedJudge
from vergence_metric.tracking.saccade_detector import Told
from vergence_metric.tracking.track import Track, TrackStatus
from vergence_metric.tracking.tracker import TargetTracker
from vergence_rig.camera import CameraModel
from vergence_rig.geometry import EyeAngles
from vergence_rig.parameters import Parameters
from vergence_rig.rig import Rig

Models = tuple[CameraModel, CameraModel]


class PairMeasurement:
    """Metric I, the fovea's signed disparity and the followed target of pair after pair, in order of their stamps."""

    def __init__(self, parameters: EdgeMetricNodeParameters, rig: Rig) -> None:
        self._baseline_m = rig.baseline_m
        self._rig_models = (CameraModel(rig.left_camera), CameraModel(rig.right_camera))
        self._tracker: TargetTracker | None = None
        self._models: Models | None = None
        self._ids_used = 0
        self._newest_id = 0
        self._parameters = parameters
        self._metric = EdgeMetric(parameters)
        self._judge = VergedJudge(parameters)
        self._estimator = make_estimator(parameters)

    @property
    def parameters(self) -> EdgeMetricNodeParameters:
        """The parameters in force."""
        return self._parameters

    def set_parameters(self, parameters: EdgeMetricNodeParameters) -> None:
        """Measure the next pair by these; what is unconcerned keeps what it has learnt, the tracker its target."""
        before, self._parameters = self._parameters, parameters
        if _differ(EdgeMetricParameters, before, parameters):
            self._metric = EdgeMetric(parameters)
            self._judge = VergedJudge(parameters)
        if _differ(DisparityParameters, before, parameters):
            self._estimator = make_estimator(parameters)
            self._tracker = None
        if _differ(TrackerParameters, before, parameters):
            self._tracker = None

    def edge(self, left: NDArray[Any], right: NDArray[Any]) -> EdgeMetricResult:
        """Return metric I of a pair of images of one size; raises ImageShapeError for others."""
        return self._metric.measure(left, right)

    def settle(self) -> None:
        """Do what was put off until the pair's figures are out."""
        self._metric.settle()

    def disparity(self, edge: EdgeMetricResult) -> Disparity:
        """Return the signed disparity at the left image's centre of a pair measured by `edge`."""
        return self._estimator.estimate(edge.left_grey, edge.right_grey)

    def verged(self, edge: EdgeMetricResult, error_px: float, confidence: float) -> bool:
        """Tell whether the eyes are verged, by the fovea's contrast, the signed error, and the last verdict."""
        return self._judge.update(edge.foveal_contrast, error_px, confidence)

    def track(
        self,
        edge: EdgeMetricResult,
        stamp_s: float,
        eyes: EyeAngles | None,
        models: Models | None,
        on_the_way: Iterable[Told] = (),
    ) -> Track:
        """Return where the target is in a pair measured by `edge`.

        Args:
            edge: the pair.
            stamp_s: of the left image.
            eyes: joint angles at the images' stamps, None if they are not known.
            models: both cameras; None takes those of the rig, if they are of the images' size.
            on_the_way: joint angles that were told since the pair before, in order of their stamps [s].
        """
        height, width = edge.left_grey.shape
        models = models or self._rig_models
        if any((model.width_px, model.height_px) != (width, height) for model in models):
            return self._nothing(f"no camera is described for images of {width}x{height}")
        if eyes is None:
            return self._nothing("no joint_states at the image's stamp")
        if self._tracker is None or models != self._models:
            self._models, self._ids_used = models, self._newest_id
            self._tracker = TargetTracker(self._parameters, self._estimator, *models, self._baseline_m)
        track = self._tracker.update(edge.left_grey, edge.right_grey, stamp_s, eyes, on_the_way)
        self._newest_id = self._ids_used + track.track_id
        return replace(track, track_id=self._newest_id)

    def _nothing(self, reason: str) -> Track:
        return Track.nowhere(self._newest_id, TrackStatus.UNLOCKED, reason)


def _differ(kind: type[Parameters], one: Parameters, other: Parameters) -> bool:
    """Tell whether two sets differ in a parameter of the part `kind`."""
    return one is not other and any(getattr(one, s.name) != getattr(other, s.name) for s in kind.specs())
