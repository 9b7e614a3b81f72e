"""camera_node: one camera on `image_raw/compressed`, `image_raw` and `camera_info`."""

import time
from collections.abc import Sequence
from typing import Any

from rclpy.duration import Duration
from rclpy.node import Node
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from std_msgs.msg import Header

from vergence_camera.capture_loop import CaptureLoop, RetryPolicy
from vergence_camera.capture_statistics import CaptureSnapshot, CaptureStatistics
from vergence_camera.control_port import ControlPort
from vergence_camera.devices import SystemTree, choose, find_devices
from vergence_camera.errors import CameraError, CorruptFrameError
from vergence_camera.frame import Encoding, Frame, ModeRequest
from vergence_camera.pair import EyeCamera
from vergence_camera.parameters import GROUPS, CameraParameters, ReplayParameters, RetryParameters
from vergence_camera.pixels import decode, encode_jpeg
from vergence_camera.ros.calibration_service import CalibrationService
from vergence_camera.ros.camera_controls import PREFIX, CameraControls
from vergence_camera.ros.camera_messages import JpegSerializer
from vergence_camera.ros.partner import PartnerCamera
from vergence_camera.ros.stored_images import StoredImages
from vergence_camera.source_choice import SourceOptions, make_source, shown_choice
from vergence_camera.stamps import Stamp, Stamper
from vergence_camera.v4l2.kernel import Kernel
from vergence_common.diagnostics import ERROR, OK, STALE, WARN, Diagnostics, Report
from vergence_common.images import array_to_image
from vergence_common.local_images import LocalImages
from vergence_common.node_main import run_node
from vergence_common.parameters import ParameterSet, declare
from vergence_common.qos import IMAGE_QOS, watch_qos
from vergence_common.stamps import from_nanoseconds
from vergence_rig.rig_file import load_rig

_SILENT_S = 0.5


class CameraNode(Node):
    """Publishes one camera, and hands its images to nodes of this process by `images`.

    `kernel` and `tree` replace the machine's own in tests; other options go to Node.
    """

    def __init__(
        self,
        *,
        kernel: Kernel | None = None,
        tree: SystemTree | None = None,
        images: LocalImages | None = None,
        **node_options: Any,
    ) -> None:
        super().__init__("camera_node", **node_options)
        self._tree = tree or SystemTree()
        self._port = ControlPort(lambda text: self._log(text, True))
        self._controls = CameraControls(self, self._port)
        self._settings = declare(self, GROUPS, allow_prefixes=(PREFIX,))
        settings: CameraParameters = self._settings.value
        eye = self.get_namespace().rpartition("/")[2]
        self._frame_id = settings.frame_id or f"{eye}_camera_optical_frame".lstrip("_")
        self._serialise = JpegSerializer(self._frame_id)
        self._controls.configure(settings.lock, settings.lock_after_s)
        self._rig_size = self._size_in_rig(settings.rig, eye)

        diagnostics = Diagnostics(self, hardware_id=shown_choice(settings.device))
        qos = watch_qos(self, diagnostics)
        self._images, self._topic = images or LocalImages(), self.resolve_topic_name("image_raw")
        self._images.offer(self._topic)
        self._wanted = (False, False, False)
        topics = ((CompressedImage, "image_raw/compressed"), (CameraInfo, "camera_info"), (Image, "image_raw"))
        self._publishers_of_frames = tuple(
            qos.create_publisher(kind, topic, IMAGE_QOS, matched=self._update_subscribers) for kind, topic in topics
        )
        self._compressed, self._info, self._raw = self._publishers_of_frames
        name = settings.camera_name or eye or "camera"
        self._calibration = CalibrationService(self, settings.camera_info_url, name, self._frame_id)
        self._stored = StoredImages(self, self._frame_id, self._jpeg)
        self._partner: PartnerCamera | None = None
        if settings.partner:
            self._partner = PartnerCamera(
                self, settings.partner, self._tree, self._port.locked_names, self._controls.follow
            )
            diagnostics.add("pair", self._report_pair)
        diagnostics.add("camera", self._report)
        diagnostics.add("calibration", self._calibration.report)
        diagnostics.add("controls", self._controls.report)

        self._statistics = CaptureStatistics()
        self._stamper = Stamper(time.time_ns)
        self._choose_clock()
        self.add_post_set_parameters_callback(self._choose_clock)
        source = make_source(settings.device, self._source_options(), kernel=kernel, tree=self._tree, user=self._port)
        self._loop = CaptureLoop(
            source,
            self._deliver,
            self._stamper,
            self._statistics,
            retry_policy=self._retry_policy(),
            log=self._log,
            ended=self._end,
        )
        self._settings.on_change(self._on_change)
        try:
            self._calibration.set_mode(self._loop.connect())
        except CameraError as error:
            if error.permanent:
                self._loop.stop()
                raise
            self._log(f"{error}; it is tried again", True)
        self._controls.update()
        self._loop.start()

    def close(self) -> None:
        """End the capture thread and release the camera."""
        self._loop.stop()

    def _deliver(self, frame: Frame, stamp: Stamp) -> None:
        """Publish one frame, in the capture thread; each form only if it has subscribers."""
        began_ns = time.monotonic_ns()
        try:
            self._stored.add(stamp.ros_ns, frame)
            jpeg_wanted, info_wanted, raw_wanted = self._wanted
            if jpeg_wanted:
                self._compressed.publish(self._serialise(self._jpeg(frame), stamp.ros_ns))
            if info_wanted:
                self._info.publish(self._calibration.message(frame.width_px, frame.height_px, stamp.ros_ns))
            local_wanted = self._images.wanted(self._topic)
            if raw_wanted or local_wanted:
                pixels, encoding = decode(frame)
                header = self._header(stamp)
                if local_wanted:
                    self._images.deliver(self._topic, header, pixels)
                if raw_wanted:
                    self._raw.publish(array_to_image(pixels, header, encoding))
        except CorruptFrameError as error:
            self._statistics.corrupt(error)
            return
        except Exception:
            if self.context.ok():
                raise
            return  # a signal shut the context down while this frame was on its way
        if self._partner is not None:
            self._partner.skew.add_own(stamp.ros_ns)
        self._statistics.published((stamp.age_ns + time.monotonic_ns() - began_ns) * 1e-9)

    def _update_subscribers(self, _: object = None) -> None:
        """Record which topics have subscribers. Asking for every frame would cost as much as sending it."""
        self._wanted = tuple(publisher.get_subscription_count() > 0 for publisher in self._publishers_of_frames)

    def _choose_clock(self, _: object = None) -> None:
        # Without simulated time ROS time is the wall clock, and reading that directly costs a tenth.
        simulated = self.get_parameter("use_sim_time").value
        self._stamper.ros_now_ns = self._simulated_now_ns if simulated else time.time_ns

    def _simulated_now_ns(self) -> int:
        return int(self.get_clock().now().nanoseconds)

    def _header(self, stamp: Stamp) -> Header:
        return Header(stamp=from_nanoseconds(stamp.ros_ns), frame_id=self._frame_id)

    def _jpeg(self, frame: Frame) -> bytes:
        if isinstance(frame.data, bytes) and frame.encoding is Encoding.JPEG:
            return frame.data
        return encode_jpeg(decode(frame)[0], self._settings.value.jpeg_quality)

    def _source_options(self) -> SourceOptions:
        settings: CameraParameters = self._settings.value
        replay = self._settings.get(ReplayParameters)
        return SourceOptions(
            request=ModeRequest(settings.pixel_format, settings.width_px, settings.height_px, settings.rate_hz),
            replay_rate_hz=replay.rate_hz,
            replay_loop=replay.loop,
            open_timeout_s=settings.open_timeout_s,
            stall_timeout_s=settings.stall_timeout_s,
            drop_corrupt=settings.drop_corrupt,
            buffers=settings.buffers,
        )

    def _retry_policy(self) -> RetryPolicy:
        settings: CameraParameters = self._settings.value
        retry = self._settings.get(RetryParameters)
        return RetryPolicy(
            stall_s=settings.stall_timeout_s,
            max_age_s=settings.max_age_s,
            first_s=retry.first_s,
            longest_s=retry.longest_s,
            stamp_offset_s=settings.stamp_offset_s,
        )

    def _on_change(self, parameters: ParameterSet) -> None:
        settings: CameraParameters = parameters.value
        self._loop.retry_policy = self._retry_policy()
        self._controls.configure(settings.lock, settings.lock_after_s)

    def _report(self) -> Report:
        self._update_subscribers()  # not every middleware reports matches
        state = self._statistics.snapshot()
        settings: CameraParameters = self._settings.value
        request = self._source_options().request
        values = {
            "device": shown_choice(settings.device),
            "requested": request,
            "mode": state.mode or "none",
            **state.values(),
        }
        values["stamps_pushed_forward"], values["clock_jumps"] = self._stamper.pushed_forward, self._stamper.clock_jumps
        if state.ended:
            return Report(STALE, "the recording has ended", values)
        if not state.connected or state.mode is None:
            return Report(ERROR, state.last_fault or "not connected yet", values)
        if state.unpublished_s > settings.stall_timeout_s + _SILENT_S:
            return Report(ERROR, f"no image is published for {state.unpublished_s:.1f} s: {_cause(state)}", values)
        if state.mode.rate_hz and state.rate_hz < 0.9 * state.mode.rate_hz:
            text = f"{state.rate_hz:.1f} Hz of {state.mode.rate_hz:g} Hz: a dim room, or USB or CPU at their limit"
            return Report(WARN, text, values)
        if request.soft_mismatch(state.mode):
            return Report(WARN, f"requested {request}, the camera gives {state.mode}", values)
        if self._rig_size is not None and self._rig_size != (state.mode.width_px, state.mode.height_px):
            return Report(
                WARN,
                f"rig.yaml has images of {self._rig_size[0]}x{self._rig_size[1]}, the camera gives {state.mode}",
                values,
            )
        return Report(OK, f"streaming {state.mode}", values)

    def _report_pair(self) -> Report:
        assert self._partner is not None
        settings: CameraParameters = self._settings.value
        try:
            controller = choose(settings.device, find_devices(self._tree)).controller
        except CameraError:
            controller = ""
        values, names = self._port.values(), self._port.locked_names()
        shared = {name: values[name] for name in names if name in values}
        own = EyeCamera(self.get_fully_qualified_name(), controller, self._statistics.snapshot().rate_hz, shared)
        return self._partner.report(own, settings.max_skew_s)

    def _size_in_rig(self, path: str, eye: str) -> tuple[int, int] | None:
        rig = load_rig(path)
        spec = {"left": rig.left_camera, "right": rig.right_camera}.get(eye)
        return None if spec is None else (spec.width_px, spec.height_px)

    def _end(self) -> None:
        """Wait until the last frames have arrived, then end the process: a recording played once is a finite task."""
        for publisher in self._publishers_of_frames:
            publisher.wait_for_all_acked(Duration(seconds=3))
        self.context.try_shutdown()

    def _log(self, text: str, warning: bool) -> None:
        if warning:
            self.get_logger().warning(text)
        else:
            self.get_logger().info(text)


def _cause(state: CaptureSnapshot) -> str:
    """Return why frames that arrive are not published."""
    if state.too_old:
        return f"{state.too_old} frames are older than max_age_s when they arrive (stamp_offset_s shifts their stamps)"
    return state.last_fault or "no whole frame arrives"


def main(args: Sequence[str] | None = None) -> int:
    """Run the node; see run_node for the exit status."""
    return run_node(CameraNode, args, GROUPS)
