"""Stands in for a user of the controller: publishes gaze/target 20 times a second until ended.

python gaze_target.py X_M Y_M Z_M
"""

import sys
from contextlib import suppress

import rclpy
from geometry_msgs.msg import PointStamped
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node


def main() -> None:
    rclpy.init()
    node = Node("gaze_target")
    publisher = node.create_publisher(PointStamped, "gaze/target", 10)
    message = PointStamped()
    message.header.frame_id = "rig_base"
    message.point.x, message.point.y, message.point.z = (float(text) for text in sys.argv[1:4])

    def publish() -> None:
        message.header.stamp = node.get_clock().now().to_msg()
        publisher.publish(message)

    node.create_timer(0.05, publish)
    rclpy.spin(node)


if __name__ == "__main__":
    with suppress(KeyboardInterrupt, ExternalShutdownException):
        main()
