"""edge_metric_node: pairs of images in, metric I, the signed error of the fovea and the followed target out."""

import math
from collections import deque
from collections.abc import Sequence
from functools import partial
from time import monotonic, monotonic_ns
from typing import Any

from sensor_msgs.msg import Image
from std_msgs.msg import Header

from vergence_common.diagnostics import ERROR, OK, WARN, Diagnostics, Report
from vergence_common.images import array_to_image
from vergence_common.node_main import run_node
from vergence_common.parameters import ParameterSet, declare
from vergence_common.qos import IMAGE_QOS, watch_qos
from vergence_common.stamps import to_nanoseconds
from vergence_metric.alignment.parameters import AlignmentParameters
from vergence_metric.disparity.angular_disparity import angular_disparity
from vergence_metric.disparity.parameters import DisparityParameters
from vergence_metric.edges.parameters import ContrastParameters, EdgeParameters
from vergence_metric.measurement.edge_metric import EdgeMetricResult
from vergence_metric.measurement.overlay import draw_overlay
from vergence_metric.measurement.pair_measurement import PairMeasurement, SeenPair
from vergence_metric.measurement.parameters import GROUPS, PairMeasurementParameters, VergedParameters
from vergence_metric.pairs.eye_order import EyeOrderMonitor
from vergence_metric.pairs.ideal_images import Models
from vergence_metric.pairs.latest_worker import LatestWorker
from vergence_metric.pairs.parameters import PairingParameters, StereoParameters
from vergence_metric.pairs.picture_faults import PictureMonitor
from vergence_metric.ros.edge_messages import edge_message, error_message, unusable_edge_message, unusable_error_message
from vergence_metric.ros.image_pair import IdealPair, ImagePair
from vergence_metric.ros.metric_node import MetricNode, limit_threads
from vergence_metric.ros.stereo_input import StereoInput
from vergence_metric.ros.stored_images import StoredImages
from vergence_metric.ros.track_messages import track_message, track_request, unusable_track_message
from vergence_metric.tracking.parameters import TrackerParameters
from vergence_msgs.msg import EdgeVergence, TargetTrack, TrackRequest, VergenceError
from vergence_rig.rig_file import load_rig

_CONNECTED_NS = 500_000_000  # after which cameras and this node have found one another again
_JOINT_SAMPLES_NS = 500_000_000  # longer than two pairs can be apart while the tracker still follows


class EdgeMetricNode(MetricNode):
    """Measures the newest pair on its own thread; the executor's thread only receives images and pairs them."""

    def __init__(self, **options: Any) -> None:
        super().__init__("edge_metric_node", **options)
        self._settings = declare(self, GROUPS)
        stereo = self._settings.get(StereoParameters)
        limit_threads(stereo.threads)
        self._rig = load_rig(stereo.rig)
        self._measurement = PairMeasurement(_measurement_parameters(self._settings), self._rig)
        self._pictures, self._order = PictureMonitor(), EyeOrderMonitor()
        diagnostics = Diagnostics(self)
        qos = watch_qos(self, diagnostics)
        self._edge_publisher = self._output(qos, EdgeVergence, "vergence/edge")
        self._error_publisher = self._output(qos, VergenceError, "vergence/error")
        self._track_publisher = self._output(qos, TargetTrack, "vergence/track")
        self._overlay_publisher = self._output(qos, Image, "vergence/overlay", IMAGE_QOS)
        self._worker: LatestWorker[ImagePair] = LatestWorker(self._measure, self._on_failure, "measure")
        pairing = self._settings.get(PairingParameters)
        submit = self._worker.submit
        self._stereo = StereoInput(self, stereo, pairing, diagnostics, qos, submit, self._rig, images=self._images)
        self._joint_input = self._subscribe_joints(diagnostics, qos)
        self._stored = StoredImages(self)
        self._requests: deque[tuple[TrackRequest, ImagePair | None]] = deque()
        self._request_subscription = qos.create_subscription(TrackRequest, "vergence/track_request", self._on_request)
        self._settings.on_change(self._on_settings)
        diagnostics.add("measurement", self._report)
        diagnostics.add("pictures", self._report_pictures)
        diagnostics.add("outputs", self._report_outputs)

    def _on_settings(self, settings: ParameterSet) -> None:
        stereo = settings.get(StereoParameters)
        limit_threads(stereo.threads)
        self._stereo.set_parameters(stereo, settings.get(PairingParameters))

    def _may_pause(self) -> bool:
        # A request names an image of the past: it is here, or the cameras have it, or it is lost.
        return self._stored.available or not self.count_publishers("vergence/track_request")

    def _on_request(self, message: TrackRequest) -> None:
        missed = to_nanoseconds(message.header.stamp) < self._stereo.resumed_ns + _CONNECTED_NS
        if message.goal_id and (self._stereo.paused or missed) and self._stored.available:
            self._heard_s = monotonic()
            self._stereo.resume()
            self._stored.get(message.header.stamp, partial(self._add_request, message))
        else:
            self._add_request(message, None)

    def _add_request(self, message: TrackRequest, stored: ImagePair | None) -> None:
        self._requests.append((message, stored))

    def _pass_on_requests(self) -> None:
        """Pass the requests on, in pixels of ideal images; in the measuring thread."""
        while self._requests:
            message, stored = self._requests.popleft()
            seen = None
            if stored is not None:
                ideal = self._stereo.cameras.ideal(stored, grey=True)
                eyes = self._joints.at(stored.left_stamp_ns, stored.right_stamp_ns)
                if eyes is not None:
                    seen = SeenPair(stored.left_stamp_ns * 1e-9, ideal.left, ideal.right, eyes)
            self._measurement.request_track(track_request(message, self._stereo.cameras.eye_images), seen)

    def _measure(self, pair: ImagePair) -> None:
        self._measurement.set_parameters(_measurement_parameters(self._settings))
        header, skew_s = pair.left.header, pair.skew_ns * 1e-9
        with self._times.measure("pictures"):
            fault = self._pictures.update(pair.left_stamp_ns * 1e-9, pair.left.pixels, pair.right.pixels)
        if fault is not None and fault.unusable:
            self._publish_unusable(fault.reason, header, skew_s)
            return
        with self._times.measure("ideal_images"):
            ideal = self._stereo.cameras.ideal(pair, grey=True)
        models = ideal.cameras
        with self._times.measure("pictures"):
            self._update_order(pair, ideal)
        self._pass_on_requests()
        if not self._subscribers():
            eyes = self._joints.at(pair.left_stamp_ns, pair.right_stamp_ns)
            stamp_s = pair.left_stamp_ns * 1e-9
            self._measurement.remember(ideal.left, ideal.right, stamp_s, eyes, models and models[0])
            self._failure = None
            return
        with self._times.measure("metric"):
            edge = self._measurement.edge(ideal.left, ideal.right, ideal.seen_px)
        if self._edge_publisher.get_subscription_count() or self._error_publisher.get_subscription_count():
            self._publish_fovea(edge, models, header, skew_s)
        self._times.add("edge_after_images", (monotonic_ns() - max(pair.left.arrived_ns, pair.right.arrived_ns)) * 1e-9)
        self._times.add_all(edge.stage_s)
        self._publish_track(pair, edge, ideal)
        if self._overlay_publisher.get_subscription_count():
            with self._times.measure("overlay"):
                disparity = self._measurement.disparity(edge)
                picture = draw_overlay(self._stereo.cameras.ideal(pair).left, edge, disparity)
                self._overlay_publisher.publish(array_to_image(picture, header))
        self._measurement.update_alignment()
        self._failure = None

    def _update_order(self, pair: ImagePair, ideal: IdealPair) -> None:
        eyes = self._joints.at(pair.left_stamp_ns, pair.right_stamp_ns)
        vergence_rad = math.nan if eyes is None else eyes.vergence_rad
        focal_px = math.nan if ideal.cameras is None else ideal.cameras[0].fx_px
        stamp_s = pair.left_stamp_ns * 1e-9
        self._order.update(stamp_s, ideal.left, ideal.right, vergence_rad, focal_px)

    def _publish_unusable(self, reason: str, header: Header, pair_skew_s: float) -> None:
        estimator = self._settings.get(DisparityParameters).estimator
        windows_px = self._settings.get(EdgeParameters).windows_px
        self._error_publisher.publish(unusable_error_message(estimator, reason, header, pair_skew_s))
        self._edge_publisher.publish(unusable_edge_message(windows_px, header, pair_skew_s))
        self._track_publisher.publish(unusable_track_message(reason, header, pair_skew_s))
        self._failure = None

    def _publish_fovea(self, edge: EdgeMetricResult, models: Models | None, header: Header, pair_skew_s: float) -> None:
        with self._times.measure("disparity"):
            disparity = self._measurement.disparity(edge)
        angular = models and angular_disparity(
            *models, disparity.point_px, disparity.horizontal_px, disparity.vertical_px
        )
        with self._times.measure("publish"):
            error = error_message(disparity, angular, header, pair_skew_s)
            verged = self._measurement.verged(edge, error.horizontal_px, error.confidence, disparity.surface)
            self._error_publisher.publish(error)
            if self._edge_publisher.get_subscription_count():
                # Its arrays are measured only now.
                self._edge_publisher.publish(edge_message(edge, verged, header, pair_skew_s))

    def _publish_track(self, pair: ImagePair, edge: EdgeMetricResult, ideal: IdealPair) -> None:
        models = ideal.cameras
        with self._times.measure("tracker"):
            now_ns, last_ns = pair.left_stamp_ns, max(pair.left_stamp_ns, pair.right_stamp_ns)
            eyes = self._joints.at(now_ns, pair.right_stamp_ns)
            samples = [
                (stamp_ns * 1e-9, angles)
                for stamp_ns, angles in self._joints.samples_between(now_ns - _JOINT_SAMPLES_NS, last_ns)
            ]
            why = "" if eyes is not None else self._joints.gap(last_ns)
            track = self._measurement.track(edge, now_ns * 1e-9, eyes, models and models[0], samples, why)
        angular = models and angular_disparity(*models, track.left_px, track.disparity_px, track.vertical_px)
        skew_s = pair.skew_ns * 1e-9
        self._track_publisher.publish(track_message(track, edge, angular, ideal.eye_images, pair.left.header, skew_s))

    def _report_pictures(self) -> Report:
        fault = self._pictures.fault
        if fault is None and self._order.fault:
            return Report(ERROR, self._order.fault)
        if fault is None:
            return Report(OK, "the pictures are neither frozen, nor the same in both eyes, nor black or white")
        return Report(ERROR, f"{fault.reason}{'; nothing is measured' if fault.unusable else ''}")

    def _report(self) -> Report:
        worked, dropped = self._worker.worked, self._worker.dropped
        values: dict[str, object] = {"measured": worked, "dropped": dropped}
        values |= self._stereo.decode_times.summary() | self._times.summary()
        if self._measurement.unmet_request:
            values["track_request"] = self._measurement.unmet_request
        if self._failure is not None:
            return Report(ERROR, f"measuring the last pair failed: {self._failure}", values)
        if dropped:
            return Report(WARN, f"measuring is too slow: {dropped} of {worked + dropped} pairs were dropped", values)
        return Report(OK, f"{worked} pairs measured", values)


def _measurement_parameters(settings: ParameterSet) -> PairMeasurementParameters:
    return PairMeasurementParameters(
        settings.get(EdgeParameters),
        settings.get(ContrastParameters),
        settings.get(AlignmentParameters),
        settings.get(VergedParameters),
        settings.get(DisparityParameters),
        settings.get(TrackerParameters),
    )


def main(args: Sequence[str] | None = None) -> int:
    """Run the node; see `vergence_common.node_main`."""
    return run_node(EdgeMetricNode, args, GROUPS)
