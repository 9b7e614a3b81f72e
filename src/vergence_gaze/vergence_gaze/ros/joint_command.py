"""The publisher of joint_command: every change at once, and a command that stays only as often as servos need it."""

from array import array

import numpy as np
import numpy.typing as npt
from rclpy.publisher import Publisher
from sensor_msgs.msg import JointState

from vergence_common.stamps import to_stamp
from vergence_rig.rig import JOINT_NAMES

REPEATED_S = 0.1
"""Time after which an unchanged command is sent again: well within the servos' time-out, and servos that have just been
started, or that another node has moved, are sent where they belong."""


class JointCommandOutput:
    """Publishes commands of all joints (3,) [rad]. One message is filled anew for each: making one costs more."""

    def __init__(self, publisher: Publisher) -> None:
        self._publisher = publisher
        self._message = JointState(name=list(JOINT_NAMES))
        self._sent: list[float] | None = None
        self._sent_s = 0.0

    def update(self, joints_rad: npt.NDArray[np.float64] | None, now_s: float) -> None:
        """Publish the command of a cycle if it is due; None where nothing is commanded."""
        angles = None if joints_rad is None else joints_rad.tolist()
        repeated = angles == self._sent and 0.0 <= now_s - self._sent_s < REPEATED_S
        if angles is None or repeated:
            self._sent = angles
            return
        self._message.header.stamp = to_stamp(now_s)
        self._message.position = array("d", angles)
        self._publisher.publish(self._message)
        self._sent, self._sent_s = angles, now_s
