"""Records what a `Head` sees and does: pictures as JPEG, camera_info, joint angles and commands."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from vergence.bags.topics import SIDES, TOPICS
from vergence.bags.writer import BagWriter
from vergence.body import Array, JointAngles, Picture
from vergence_camera.pixels import encode_jpeg
from vergence_rig.camera import CameraModel
from vergence_rig.head_bodies import OPTICAL_FRAMES
from vergence_rig.rig import JOINT_NAMES

_QUALITY = 95


class HeadRecorder:
    """Writes a bag of one head, in its root namespace.

    Args:
        path: folder of the new bag. Raises BagError if it exists.
        cameras: what is published of both cameras, left and right; None for one that is not calibrated.
    """

    def __init__(self, path: str | Path, cameras: tuple[CameraModel | None, CameraModel | None]) -> None:
        self._cameras = cameras
        self._writer = BagWriter(path)
        self._types: Mapping[str, Any] = self._writer.types()

    def on_picture(self, picture: Picture, now_ns: int) -> None:
        """Record a picture that has arrived."""
        eye, height, width = SIDES[picture.side], *picture.pixels.shape[:2]
        header = self._header(picture.stamp_ns, OPTICAL_FRAMES[eye])
        image = self._types["sensor_msgs/msg/CompressedImage"]
        jpeg = np.frombuffer(encode_jpeg(picture.pixels, _QUALITY), np.uint8)
        self._write(f"{eye}/image_raw/compressed", now_ns, image(header, "bgr8; jpeg compressed bgr8", jpeg))
        self._write(f"{eye}/camera_info", now_ns, self._info(header, self._cameras[picture.side], width, height))

    def on_joints(self, joints: JointAngles, now_ns: int) -> None:
        """Record joint angles that have arrived."""
        self._write("joint_states", now_ns, self._joint_state(joints.stamp_ns, joints.angles_rad))

    def on_command(self, joints_rad: Array, now_ns: int) -> None:
        """Record a command (3,) [rad]."""
        self._write("joint_command", now_ns, self._joint_state(now_ns, joints_rad))

    def close(self) -> None:
        """Finish the bag; idempotent."""
        self._writer.close()

    def _write(self, topic: str, now_ns: int, message: Any) -> None:
        name = f"/{topic}"
        if name not in self._writer.counts:
            self._writer.add(name, TOPICS[topic])
        self._writer.write(name, now_ns, message)

    def _header(self, stamp_ns: int, frame: str) -> Any:
        sec, nanosec = divmod(stamp_ns, 1_000_000_000)
        stamp = self._types["builtin_interfaces/msg/Time"](sec, nanosec)
        return self._types["std_msgs/msg/Header"](stamp, frame)

    def _joint_state(self, stamp_ns: int, angles_rad: Array) -> Any:
        none = np.empty(0)
        kind = self._types["sensor_msgs/msg/JointState"]
        return kind(self._header(stamp_ns, ""), list(JOINT_NAMES), np.asarray(angles_rad, np.float64), none, none)

    def _info(self, header: Any, camera: CameraModel | None, width: int, height: int) -> Any:
        matrix, distortion, model = np.zeros(9), np.empty(0), ""
        if camera is not None:
            matrix = np.array([camera.fx_px, 0, camera.cx_px, 0, camera.fy_px, camera.cy_px, 0, 0, 1.0])
            distortion, model = camera.distortion, camera.distortion_model
        projection = np.insert(matrix.reshape(3, 3), 3, 0.0, axis=1).ravel()
        region = self._types["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False)
        return self._types["sensor_msgs/msg/CameraInfo"](
            header, height, width, model, distortion, matrix, np.eye(3).ravel(), projection, 0, 0, region
        )
