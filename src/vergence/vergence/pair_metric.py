"""Pairs of pictures to measurements, with the objects that edge_metric_node uses."""

import math
from dataclasses import dataclass, replace

from vergence.body import JointAngles, Pixels
from vergence_gaze.estimation.observations import EdgeContrast, Observation, TrackSighting
from vergence_gaze.goals.goal import TrackRequest
from vergence_metric.disparity import Disparity
from vergence_metric.disparity.angular_disparity import AngularDisparity, angular_disparity
from vergence_metric.edges.edges import to_grey
from vergence_metric.measurement.edge_metric import EdgeMetricResult
from vergence_metric.measurement.pair_measurement import PairMeasurement
from vergence_metric.measurement.parameters import PairMeasurementParameters
from vergence_metric.pairs.ideal_images import IdealImages, Models
from vergence_metric.pairs.pairing import Pair
from vergence_metric.tracking.request import TrackRequest as PixelRequest
from vergence_metric.tracking.track import Track, TrackStatus
from vergence_rig.camera import CameraModel
from vergence_rig.eye_image import EyeImage
from vergence_rig.geometry import EyeAngles
from vergence_rig.joint_history import JointHistory
from vergence_rig.rig import JOINT_NAMES, Rig

_JOINT_SAMPLES_NS = 500_000_000  # longer than two pairs can be apart while the tracker still follows
_BOTH = (TrackStatus.OK, TrackStatus.AMBIGUOUS)


@dataclass(frozen=True)
class Measurement:
    """What one pair of pictures shows.

    Attributes:
        stamp_s: exposure of the left picture.
        skew_s: that of the right one less that of the left one.
        left: the left picture as it was taken, (h, w, 3) BGR.
        right: the right one.
        edge: metric I per window: `windows_px`, `left_to_right_px`, `right_to_left_px`, `contrast`, `left_edges`, ...
        disparity: the signed disparity at the fovea, in ideal images.
        angular: the same in angles; `horizontal_rad` is what to add to the vergence angle.
        track: the followed target.
        verged: whether both eyes look at what lies at the fovea, by contrast and signed disparity.
    """

    stamp_s: float
    skew_s: float
    left: Pixels
    right: Pixels
    edge: EdgeMetricResult
    disparity: Disparity
    angular: AngularDisparity
    track: Track
    verged: bool

    def __str__(self) -> str:
        """Return one line: vergence, contrast, disparity."""
        least, found = self.edge.least_contrast, self.disparity
        where = f"disparity {found.horizontal_px:+.2f} px, sigma {found.sigma_px:.2f} px"
        return (
            f"{'verged' if self.verged else 'not verged'}: contrast {least.contrast:.2f} at {least.window_px} px, "
            f"{where if found.ok else 'no disparity: ' + found.reason}"
        )


@dataclass(frozen=True)
class _Seen:
    """A pair that was measured for the controller; the rest is measured when it is asked for."""

    pair: Pair[Pixels]
    models: Models
    edge: EdgeMetricResult
    track: Track


class PairMetric:
    """Measures one pair after the other, as edge_metric_node does.

    Args:
        rig: describes the cameras that are not calibrated.
        cameras: the calibrated ones, left and right.
        parameters: of the metric.
    """

    def __init__(
        self,
        rig: Rig,
        cameras: tuple[CameraModel | None, CameraModel | None],
        parameters: PairMeasurementParameters,
    ) -> None:
        self._rig, self._cameras = rig, cameras
        self._measurement = PairMeasurement(parameters, rig)
        self._joints, self.ideal = JointHistory(), IdealImages(rig)
        """Draws the ideal images."""
        self._seen: _Seen | None = None
        self._measured: tuple[_Seen, Measurement] | None = None
        self.images: tuple[EyeImage, EyeImage] | None = None
        """How pictures map to ideal ones; None before the first pair."""

    @property
    def newest(self) -> Pair[Pixels] | None:
        """The newest pair that was measured; None before the first."""
        return None if self._seen is None else self._seen.pair

    def add_joints(self, joints: JointAngles) -> None:
        """Note joint angles."""
        self._joints.add(joints.stamp_ns, JOINT_NAMES, self._rig.eye_angles(joints.angles_rad.tolist()))

    def eyes_at(self, pair: Pair[Pixels]) -> EyeAngles | None:
        """Return the reported eye angles at the exposures of a pair; None if they are not known."""
        return self._joints.at(pair.left_stamp_ns, pair.right_stamp_ns)

    def request_pixel(self, request: PixelRequest) -> None:
        """Let the tracker follow a point of a picture as it was taken."""
        if self.images is not None and request.goal_id and not request.motion:
            x_px, y_px = self.images[0 if request.left_eye else 1].to_ideal([request.pixel])[0]
            request = replace(request, pixel=(float(x_px), float(y_px)))
        self._measurement.request_track(request)

    def request_track(self, request: TrackRequest) -> None:
        """Let the tracker follow what the controller asks for."""
        images = self.images
        pixel, extent_px = (math.nan, math.nan), None
        if request.goal_id and not request.motion and images is not None:
            x_px, y_px = images[0 if request.left_eye else 1].ideal.distort([request.xy])[0]
            pixel = float(x_px), float(y_px)
            width_rad, height_rad = request.extent_rad
            if math.isfinite(width_rad) and math.isfinite(height_rad):
                focal_px = images[0].fx_px
                extent_px = focal_px * width_rad, focal_px * height_rad
        self._measurement.request_track(
            PixelRequest(request.goal_id, request.stamp_s, request.left_eye, pixel, extent_px, request.motion)
        )

    def observe(self, pair: Pair[Pixels]) -> list[Observation]:
        """Measure a pair and return what the controller reads of it."""
        self._measurement.update_alignment()
        models = self.ideal.cameras(self._cameras, (pair.left, pair.right))
        self.images = self.ideal.set_cameras(models)
        left, right = self.ideal.draw(to_grey(pair.left), to_grey(pair.right))
        edge = self._measurement.edge(left, right, self.ideal.seen_px)
        ideal = self.images[0].ideal, self.images[1].ideal
        track = self._track(pair, edge, ideal[0])
        self._seen = _Seen(pair, ideal, edge, track)
        stamp_s = pair.left_stamp_ns * 1e-9
        contrast = EdgeContrast(stamp_s, edge.target_contrast(track.surface).contrast, math.nan)
        return [contrast, track_sighting(track, ideal, stamp_s, pair.skew_ns * 1e-9)]

    def measurement(self) -> Measurement | None:
        """Return what the newest pair shows; None before the first."""
        seen = self._seen
        if seen is None:
            return None
        if self._measured is None or self._measured[0] is not seen:
            disparity = self._measurement.disparity(seen.edge)
            angular = angular_disparity(
                *seen.models, disparity.point_px, disparity.horizontal_px, disparity.vertical_px
            )
            verged = self._measurement.verged(seen.edge, angular.horizontal_px, disparity.confidence, disparity.surface)
            pair = seen.pair
            shown = Measurement(
                pair.left_stamp_ns * 1e-9,
                pair.skew_ns * 1e-9,
                pair.left,
                pair.right,
                seen.edge,
                disparity,
                angular,
                seen.track,
                verged,
            )
            self._measured = (seen, shown)
        return self._measured[1]

    def _track(self, pair: Pair[Pixels], edge: EdgeMetricResult, camera: CameraModel) -> Track:
        now_ns, right_ns = pair.left_stamp_ns, pair.right_stamp_ns
        eyes = self.eyes_at(pair)
        samples = [
            (stamp_ns * 1e-9, angles)
            for stamp_ns, angles in self._joints.samples_between(now_ns - _JOINT_SAMPLES_NS, max(now_ns, right_ns))
        ]
        why = "" if eyes is not None else self._joints.gap(max(now_ns, right_ns))
        return self._measurement.track(edge, now_ns * 1e-9, eyes, camera, samples, why)


def track_sighting(track: Track, models: Models, stamp_s: float, skew_s: float) -> TrackSighting:
    """Return a track as the controller reads it; `models` are the ideal cameras.

    With ROS the same goes through TargetTrack: `track_message`, then `gaze_messages.track_sighting`.
    """
    focal_px = models[0].fx_px
    both, occluded = track.status in _BOTH, track.status is TrackStatus.OCCLUDED
    x, y = models[0].undistorted(*track.left_px) if both or occluded else (math.nan, math.nan)
    angular = angular_disparity(*models, track.left_px, track.disparity_px, track.vertical_px)
    return TrackSighting(
        stamp_s=stamp_s,
        skew_s=skew_s,
        track_id=track.track_id,
        lock_stamp_s=track.lock_stamp_s if math.isfinite(track.lock_stamp_s) else 0.0,
        left_x=x,
        left_y=y,
        disparity_rad=angular.horizontal_rad if both else math.nan,
        sigma_rad=track.sigma_px / focal_px,
        extent_rad=track.extent_px[0] / focal_px,
        usable=math.isfinite(x) and math.isfinite(y),
        reason=track.reason,
        goal_id=track.goal_id,
        ambiguous=track.status is TrackStatus.AMBIGUOUS,
        candidates=tuple((math.atan(x) - math.atan(x - px / focal_px), weight) for px, weight in track.candidates),
    )
