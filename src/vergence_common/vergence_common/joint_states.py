"""The subscription of joint_states of every node that reads them: checked, merged, and reported in its diagnostics."""

from collections.abc import Callable
from time import monotonic

from rclpy.node import Node
from sensor_msgs.msg import JointState

from vergence_common.diagnostics import Diagnostics
from vergence_common.polled_subscription import PolledSubscription
from vergence_common.qos import QosWatch
from vergence_common.stamps import to_nanoseconds
from vergence_rig.joint_reader import JointStateReader, MergedJoints

__all__ = ["JointStateInput", "MergedJoints"]


class JointStateInput:
    """Passes the angles of all joints to `on_joints`, once all are known, and adds the diagnostic `joint_states`."""

    def __init__(
        self,
        node: Node,
        diagnostics: Diagnostics,
        qos: QosWatch,
        on_joints: Callable[[MergedJoints], None],
        polled: bool = False,
    ) -> None:
        """Subscribe; `polled` messages wait until `poll`, as those of PolledSubscription."""
        self._node, self._on_joints = node, on_joints
        self.reader = JointStateReader()
        self._polled: PolledSubscription | None = None
        if polled:
            self._polled = PolledSubscription(node, qos, JointState, "joint_states", self._on_message)
        else:
            qos.create_subscription(JointState, "joint_states", self._on_message)
        diagnostics.add("joint_states", lambda: self.reader.report(monotonic()))

    def poll(self) -> None:
        """Pass on what has arrived, where it waits for that."""
        if self._polled is not None:
            self._polled.poll()

    def close(self) -> None:
        """Receive nothing more."""
        if self._polled is not None:
            self._polled.close()

    def problem(self) -> str:
        """Return why no usable joint state arrives now; empty while they do."""
        return self.reader.problem(monotonic())

    def _on_message(self, message: JointState) -> None:
        stamp_ns, clock_ns = to_nanoseconds(message.header.stamp), self._node.get_clock().now().nanoseconds
        merged = self.reader.read(stamp_ns, message.name, message.position, clock_ns, monotonic())
        if merged is not None:
            self._on_joints(merged)
