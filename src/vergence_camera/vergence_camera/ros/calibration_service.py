"""A camera's calibration: loads it, makes camera_info of it, and saves a new one (set_camera_info)."""

from ament_index_python.packages import get_package_share_directory
from rclpy.node import Node
from rclpy.serialization import serialize_message
from sensor_msgs.srv import SetCameraInfo
from std_msgs.msg import Header

from vergence_camera.camera_info import (
    Calibration,
    CameraCalibrationError,
    calibration_path,
    load_calibration,
    save_calibration,
)
from vergence_camera.frame import Mode
from vergence_camera.ros.camera_messages import calibration_from_message, camera_info_message
from vergence_common.diagnostics import OK, WARN, Report
from vergence_common.stamps import restamped


class CalibrationService:
    """Holds the calibration of one camera and serves `set_camera_info`."""

    def __init__(self, node: Node, url: str, name: str, frame_id: str) -> None:
        self._node, self._name, self._frame_id = node, name, frame_id
        self._path = calibration_path(url, name, get_package_share_directory)
        self._calibration: Calibration | None = None
        self._problem = f"no calibration at {self._path}: camera_info is blank"
        if url or self._path.exists():
            try:
                self._calibration = load_calibration(self._path)
            except CameraCalibrationError as error:
                self._problem = f"{error}: camera_info is blank"
                node.get_logger().warning(self._problem)
        self._size = (0, 0)
        self._message = b""
        node.create_service(SetCameraInfo, "set_camera_info", self._set)

    def message(self, width_px: int, height_px: int, stamp_ns: int) -> bytes:
        """Return the serialised camera_info for a frame of that size: blank if the calibration is for another size.

        It is the same for every frame but for its stamp.
        """
        if (width_px, height_px) != self._size:
            self._size = (width_px, height_px)
            self._refresh()
        return restamped(self._message, stamp_ns)

    def set_mode(self, mode: Mode) -> None:
        """Compare the calibration with the stream, so that a wrong size is logged before the first frame."""
        self._size = (mode.width_px, mode.height_px)
        self._refresh()

    def report(self) -> Report:
        """Return the diagnostic."""
        if self._has_size_of_stream():
            return Report(OK, "calibrated", {"file": self._path})
        return Report(WARN, self._problem, {"file": self._path})

    def _has_size_of_stream(self) -> bool:
        calibration = self._calibration
        return calibration is not None and self._size in ((0, 0), (calibration.width_px, calibration.height_px))

    def _refresh(self) -> None:
        calibration = self._calibration
        if calibration is not None and not self._has_size_of_stream():
            self._problem = (
                f"no calibration for {self._size[0]}x{self._size[1]} images: {self._path} is for "
                f"{calibration.width_px}x{calibration.height_px}: camera_info is blank"
            )
            self._node.get_logger().warning(self._problem)
        shown = calibration if self._has_size_of_stream() else None
        message = camera_info_message(shown, *self._size, Header(frame_id=self._frame_id))
        self._message = serialize_message(message)

    def _set(self, request: SetCameraInfo.Request, response: SetCameraInfo.Response) -> SetCameraInfo.Response:
        try:
            calibration = calibration_from_message(request.camera_info, self._name)
            if self._size not in ((0, 0), (calibration.width_px, calibration.height_px)):
                raise CameraCalibrationError(
                    f"image size must be the camera's, {self._size[0]}x{self._size[1]}: "
                    f"got {calibration.width_px}x{calibration.height_px}"
                )
            save_calibration(calibration, self._path)
        except (CameraCalibrationError, OSError) as error:
            response.success, response.status_message = False, str(error)
            return response
        self._calibration = calibration
        self._refresh()
        response.success, response.status_message = True, f"saved to {self._path}"
        return response
