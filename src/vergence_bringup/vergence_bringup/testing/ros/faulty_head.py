"""A head before a wall on the topics of the contract, whose messages pass through a fault on their way."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from sensor_msgs.msg import CameraInfo, Image, JointState
from std_msgs.msg import Header

from vergence_bringup.testing.textured_wall import FOCAL_PX, HEIGHT_PX, WIDTH_PX, TexturedWall
from vergence_common.images import array_to_image
from vergence_common.qos import IMAGE_QOS
from vergence_common.stamps import from_nanoseconds
from vergence_rig.rig import JOINT_NAMES, default_rig
from vergence_rig.servo import ServoPlant

TICK_S = 0.025
_TICKS_OF_A_PAIR = 2
EYES = ("left", "right")

Array = npt.NDArray[np.float64]
Pixels = npt.NDArray[np.uint8]


@dataclass
class Shown:
    """One pair on its way: pictures, stamps [ns] and headers of the messages may be changed; None is not sent."""

    pictures: list[Pixels | None]
    stamps_ns: list[int]
    number: int
    change: Callable[[Image], None] = field(default=lambda message: None)


class FaultyHead(Node):
    """Publishes images, camera_info and joint_states, and follows joint_command.

    `show`, `report` and `describe` change what is published; each is called with the message's values just before.
    While `follows` is False the servos are stuck.
    """

    def __init__(self, wall: TexturedWall, **options: Any) -> None:
        super().__init__("faulty_head", **options)
        self.wall = wall
        # Servos as rig.yaml describes them: those that have no play would be steered against it.
        self._servos = [ServoPlant(joint.servo) for _, joint in default_rig().joints.items()]
        self._ticks = 0
        self.heal()
        self._images = [self.create_publisher(Image, f"{eye}/image_raw", IMAGE_QOS) for eye in EYES]
        self._infos = [self.create_publisher(CameraInfo, f"{eye}/camera_info", IMAGE_QOS) for eye in EYES]
        self._joints = self.create_publisher(JointState, "joint_states", 10)
        self.create_subscription(JointState, "joint_command", self._on_command, 10)
        self.create_timer(TICK_S, self._tick, clock=Clock(clock_type=ClockType.STEADY_TIME))

    @property
    def joints_rad(self) -> Array:
        """True angles of the joints (3,)."""
        return np.array([servo.true_rad for servo in self._servos])

    def heal(self) -> None:
        """Publish everything as it is, and follow commands."""
        self.follows = True
        self.show: Callable[[Shown], None] = lambda shown: None
        self.report: Callable[[JointState], list[JointState]] = lambda message: [message]
        self.describe: Callable[[CameraInfo], None] = lambda message: None

    @property
    def vergence_error_rad(self) -> float:
        """True error of the eyes' vergence [rad]."""
        return float(self.joints_rad[1] - self.joints_rad[0] - self.wall.needed_rad)

    def _on_command(self, message: JointState) -> None:
        for name, angle_rad in zip(message.name, message.position, strict=False):
            if name in JOINT_NAMES and self.follows:
                self._servos[JOINT_NAMES.index(name)].command(angle_rad, self._ticks * TICK_S)

    def _tick(self) -> None:
        self.wall.step(TICK_S)
        for servo in self._servos:
            servo.step((self._ticks + 1) * TICK_S)
        now_ns = self.get_clock().now().nanoseconds
        reported = [servo.modelled_rad for servo in self._servos]
        joints = JointState(header=self._header(now_ns, ""), name=list(JOINT_NAMES), position=reported)
        for message in self.report(joints):
            self._joints.publish(message)
        self._ticks += 1
        if self._ticks % _TICKS_OF_A_PAIR == 0:
            self._publish_pair(now_ns)

    def _publish_pair(self, now_ns: int) -> None:
        pan_left, pan_right, tilt = self.joints_rad
        views: list[Pixels | None] = [self.wall.view(True, pan_left, tilt), self.wall.view(False, pan_right, tilt)]
        shown = Shown(views, [now_ns, now_ns], self._ticks // _TICKS_OF_A_PAIR)
        self.show(shown)
        for side, (eye, picture, stamp_ns) in enumerate(zip(EYES, shown.pictures, shown.stamps_ns, strict=True)):
            if picture is None:
                continue
            header = self._header(stamp_ns, f"{eye}_camera_optical_frame")
            image = array_to_image(picture, header, "mono8")
            shown.change(image)
            self._images[side].publish(image)
            info = CameraInfo(header=header, width=WIDTH_PX, height=HEIGHT_PX, distortion_model="plumb_bob")
            info.d, centre = [0.0] * 5, ((WIDTH_PX - 1) / 2, (HEIGHT_PX - 1) / 2)
            info.k = [FOCAL_PX, 0.0, centre[0], 0.0, FOCAL_PX, centre[1], 0.0, 0.0, 1.0]
            self.describe(info)
            self._infos[side].publish(info)

    @staticmethod
    def _header(stamp_ns: int, frame_id: str) -> Header:
        return Header(stamp=from_nanoseconds(max(stamp_ns, 0)), frame_id=frame_id)
