"""`python -m bench.budget_empty_node KIND`: an rclpy node with a node's subscriptions, or a reader's, and no more."""

import sys

from rclpy.node import Node
from sensor_msgs.msg import CameraInfo, Image, JointState

from vergence_common.node_main import run_node
from vergence_common.qos import IMAGE_QOS
from vergence_msgs.msg import BoxVergence, EyeRotation, TargetTrack, TrackRequest, VergenceError

_EYES = ("left", "right")
TOPICS = {
    "metric": [
        *((Image, f"{eye}/image_raw", IMAGE_QOS) for eye in _EYES),
        *((CameraInfo, f"{eye}/camera_info", 1) for eye in _EYES),
        (JointState, "joint_states", 10),
        (TrackRequest, "vergence/track_request", 10),
    ],
    "controller": [
        (JointState, "joint_states", 10),
        (VergenceError, "vergence/error", 10),
        (TargetTrack, "vergence/track", 10),
        (BoxVergence, "vergence/box", 10),
        (EyeRotation, "vergence/eye_rotation", 10),
        *((CameraInfo, f"{eye}/camera_info", 1) for eye in _EYES),
    ],
    "servo": [(JointState, "joint_command", 10)],
    "box_reader": [(BoxVergence, "vergence/box", 10)],
    "eye_rotation_reader": [(EyeRotation, "vergence/eye_rotation", 10)],
}


def _node() -> Node:
    node = Node("empty_node")
    for kind, topic, qos in TOPICS[sys.argv[1]]:
        node.create_subscription(kind, topic, lambda _: None, qos)
    return node


if __name__ == "__main__":
    raise SystemExit(run_node(_node, sys.argv[2:]))
