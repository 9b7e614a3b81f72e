"""Messages of servo_node to plain values and back."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from builtin_interfaces.msg import Duration, Time
from rclpy.node import Node
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from vergence_servo.commanders import Commander
from vergence_servo.trajectory import TrajectoryPoint


def joint_state(stamp: Time, positions_rad: Mapping[str, float], velocities_rad_s: Mapping[str, float]) -> JointState:
    """Return joint_states of modelled positions and velocities."""
    message = JointState(name=list(positions_rad), position=list(positions_rad.values()))
    message.header.stamp = stamp
    message.velocity = [velocities_rad_s.get(name, math.nan) for name in positions_rad]
    return message


def resolution(stamp: Time, steps_rad: Mapping[str, float]) -> JointState:
    """Return the smallest step of every joint, as positions [rad]."""
    message = JointState(name=list(steps_rad), position=list(steps_rad.values()))
    message.header.stamp = stamp
    return message


def duration_s(duration: Duration) -> float:
    """Return a duration in seconds."""
    return duration.sec + duration.nanosec * 1e-9


def trajectory_points(message: JointTrajectory) -> list[TrajectoryPoint]:
    """Return a trajectory's points; velocities only where they are given."""
    return [_point(point) for point in message.points]


def _point(point: JointTrajectoryPoint) -> TrajectoryPoint:
    velocities = tuple(point.velocities) or None
    return TrajectoryPoint(duration_s(point.time_from_start), tuple(point.positions), velocities)


def commanders(node: Node, topics: Sequence[str]) -> dict[str, list[Commander]]:
    """Return who publishes on each of these topics now."""
    return {
        topic: [_commander(info) for info in node.get_publishers_info_by_topic(node.resolve_topic_name(topic))]
        for topic in topics
    }


def _commander(info: Any) -> Commander:
    namespace = info.node_namespace.rstrip("/")
    return Commander(f"{namespace}/{info.node_name}", bytes(info.endpoint_gid))
