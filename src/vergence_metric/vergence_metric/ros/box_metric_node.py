"""box_metric_node: pairs of images in, the target's boxes in both eyes, metric II and the target's place out."""

import math
from collections.abc import Sequence
from typing import Any

from geometry_msgs.msg import PoseWithCovarianceStamped
from rclpy.qos import QoSDurabilityPolicy, QoSProfile
from sensor_msgs.msg import Image
from std_msgs.msg import Header

from vergence_common.diagnostics import ERROR, OK, WARN, Diagnostics, Report
from vergence_common.images import array_to_image
from vergence_common.node_main import run_node
from vergence_common.parameters import ParameterSet, declare
from vergence_common.qos import IMAGE_QOS, watch_qos
from vergence_metric.boxes import BoxMeasurement, BoxVergenceResult, DetectorError, draw
from vergence_metric.boxes.follow_parameters import FollowParameters, MotionParameters
from vergence_metric.boxes.motion import MOTION_CLASS
from vergence_metric.boxes.parameters import (
    GROUPS,
    AssociationParameters,
    BoxMeasurementParameters,
    BoxMetricNodeParameters,
    BoxMetricParameters,
    DetectorParameters,
)
from vergence_metric.pairs.latest_worker import LatestWorker
from vergence_metric.pairs.parameters import PairingParameters
from vergence_metric.ros.box_messages import (
    box_vergence_message,
    detections_message,
    point_message,
    requested_object,
    vision_message,
    vision_type,
)
from vergence_metric.ros.metric_node import MetricNode, limit_threads
from vergence_metric.ros.stereo_input import IdealPair, ImagePair, StereoInput
from vergence_msgs.msg import BoxVergence, DetectorClasses, ObjectRequest, StereoDetections
from vergence_rig.kinematics import Kinematics
from vergence_rig.parameters import ParameterError
from vergence_rig.rig_file import load_rig

EYES = ("left", "right")


class BoxMetricNode(MetricNode):
    """Measures the newest pair, at most `rate_hz` times a second, on a thread of its own."""

    def __init__(self, **options: Any) -> None:
        super().__init__("box_metric_node", **options)
        self._settings = declare(self, GROUPS)
        settings: BoxMetricNodeParameters = self._settings.value
        limit_threads(settings.threads)
        self._rig = load_rig(settings.rig)
        self._metric_parameters = _parameters_of(self._settings)
        self._measurement = BoxMeasurement(self._metric_parameters, Kinematics(self._rig), threads=settings.threads)
        self.get_logger().info(self._measurement.detector.describe())
        self._counts: dict[str, int] = {}
        self._due_ns = 0
        diagnostics = Diagnostics(self)
        qos = watch_qos(self, diagnostics)
        self._box_publisher = self._output(qos, BoxVergence, "vergence/box")
        self._point_publisher = self._output(qos, PoseWithCovarianceStamped, "vergence/target_point")
        self._detections_publisher = self._output(qos, StereoDetections, "vergence/detections")
        self._overlay_publisher = self._output(qos, Image, "vergence/box_overlay", IMAGE_QOS)
        latched = QoSProfile(depth=1, durability=QoSDurabilityPolicy.TRANSIENT_LOCAL)
        self._classes_publisher = qos.create_publisher(DetectorClasses, "vergence/detector_classes", latched)
        self._classes: tuple[str, ...] | None = None
        self._publish_classes()
        vision = vision_type()
        self._vision_publishers = [
            self._output(qos, vision, f"vergence/{eye}_detections") for eye in EYES if vision is not None
        ]
        # Simulated time stands until this is done: everything waits for it then.
        niceness = 0 if self.get_parameter("use_sim_time").value else settings.niceness
        self._worker: LatestWorker[ImagePair] = LatestWorker(self._measure, self._on_failure, "measure", niceness)
        pairing = self._settings.get(PairingParameters)
        self._stereo = StereoInput(
            self, settings, pairing, diagnostics, qos, self._on_pair, self._rig, images=self._images
        )
        self._joint_input = self._subscribe_joints(diagnostics, qos)
        qos.create_subscription(
            ObjectRequest,
            "vergence/object_request",
            lambda message: self._measurement.request(requested_object(message)),
            latched,
        )
        self._settings.add_check(self._check_classes)
        self._settings.on_change(self._on_settings)
        diagnostics.add("detector", self._report)
        diagnostics.add("outputs", self._report_outputs)

    def _check_classes(self, candidate: ParameterSet) -> None:
        classes = candidate.get(DetectorParameters).classes
        try:
            self._measurement.detector.class_ids(classes)
        except DetectorError as error:
            raise ParameterError("detector.classes", classes, f"classes of the model ({error})") from None

    def _publish_classes(self) -> None:
        classes = self._measurement.detector.classes_of(self._settings.get(DetectorParameters).classes)
        if self._settings.get(MotionParameters).enable:
            classes = (*classes, MOTION_CLASS)
        if classes != self._classes:
            self._classes = classes
            header = Header(stamp=self.get_clock().now().to_msg())
            self._classes_publisher.publish(DetectorClasses(header=header, names=list(classes)))

    def _on_settings(self, settings: ParameterSet) -> None:
        self._publish_classes()
        limit_threads(settings.value.threads)
        self._metric_parameters = _parameters_of(settings)
        self._stereo.set_parameters(settings.value, settings.get(PairingParameters))

    def _on_pair(self, pair: ImagePair) -> None:
        settings: BoxMetricNodeParameters = self._settings.value
        if not settings.enable:
            return
        period_ns = round(1e9 / settings.rate_hz)
        # A beat of its own, so that 15 Hz of 30 is every second pair; after a gap or a jump back it begins anew.
        late_ns, slack_ns = pair.left_stamp_ns - self._due_ns, period_ns // 10
        if -2 * period_ns <= late_ns < -slack_ns:
            return
        on_beat = -slack_ns <= late_ns < period_ns
        self._due_ns = (self._due_ns if on_beat else pair.left_stamp_ns) + period_ns
        self._worker.submit(pair)

    def _measure(self, pair: ImagePair) -> None:
        self._measurement.set_parameters(self._metric_parameters)
        eyes = self._joints.at(pair.left_stamp_ns, pair.right_stamp_ns)
        with self._times.measure("ideal_images"):
            ideal = self._stereo.ideal(pair)
        with self._times.measure("metric"):
            result = self._measurement.measure(ideal.left, ideal.right, pair.left_stamp_ns * 1e-9, eyes, ideal.cameras)
        self._publish(pair, ideal, result)
        self._counts[result.status.name] = self._counts.get(result.status.name, 0) + 1
        self._failure = None

    def _publish(self, pair: ImagePair, ideal: IdealPair, result: BoxVergenceResult) -> None:
        header: Header = pair.left.header
        skew_s = pair.skew_ns * 1e-9
        focal_px = ideal.cameras[0].fx_px if ideal.cameras is not None else math.nan
        self._box_publisher.publish(box_vergence_message(result, header, skew_s, focal_px))
        if result.point is not None:
            self._point_publisher.publish(point_message(result.point, header))
        if self._detections_publisher.get_subscription_count():
            self._detections_publisher.publish(detections_message(result, header, skew_s))
        seen = (result.left_detections, result.right_detections)
        eye_images, frames = ideal.eye_images or (None, None), (pair.left, pair.right)
        of_eyes = zip(seen, eye_images, frames, strict=True)
        for publisher, (detections, eye_image, frame) in zip(self._vision_publishers, of_eyes, strict=False):
            if publisher.get_subscription_count():
                publisher.publish(vision_message(detections, eye_image, frame.header))
        if self._overlay_publisher.get_subscription_count():
            with self._times.measure("overlay"):
                picture = draw(ideal.left, ideal.right, result)
                self._overlay_publisher.publish(array_to_image(picture, header))

    def _report(self) -> Report:
        values: dict[str, object] = {"model": self._measurement.detector.describe()}
        values |= {"measured": self._worker.worked, "dropped": self._worker.dropped} | self._counts
        values |= self._times.summary()
        if self._failure is not None:
            return Report(ERROR, f"the last pair could not be measured: {self._failure}", values)
        if not self._settings.value.enable:
            return Report(OK, "not enabled", values)
        if self._worker.dropped > self._worker.worked // 10:
            return Report(WARN, f"too slow for {self._settings.value.rate_hz:g} Hz", values)
        return Report(OK, f"{self._worker.worked} pairs measured", values)


def _parameters_of(settings: ParameterSet) -> BoxMetricParameters:
    return BoxMetricParameters(
        settings.get(DetectorParameters),
        settings.get(AssociationParameters),
        settings.get(FollowParameters),
        settings.get(MotionParameters),
        settings.get(BoxMeasurementParameters),
    )


def main(args: Sequence[str] | None = None) -> int:
    """Run the node; see `vergence_common.node_main`."""
    return run_node(BoxMetricNode, args, GROUPS)
