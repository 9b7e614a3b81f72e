"""head_node: cameras, metrics, control and servos in one process; images pass in memory."""

from collections.abc import Callable, Sequence

from rclpy.node import Node

from vergence_camera.ros.camera_node import CameraNode
from vergence_common.composition import parse
from vergence_common.local_images import LocalImages
from vergence_common.node_main import run_nodes
from vergence_gaze.ros.gaze_controller_node import GazeControllerNode
from vergence_metric.ros.stereo_node import METRICS, metric_makers
from vergence_servo.ros.servo_node import ServoNode

CAMERAS = {"left_camera": "left", "right_camera": "right"}
JOINTS: dict[str, Callable[..., Node]] = {"gaze_controller_node": GazeControllerNode, "servo_node": ServoNode}
USUAL = (*CAMERAS, "edge_metric_node", *JOINTS)


def main(args: Sequence[str] | None = None) -> int:
    """Run the chosen nodes of a head."""
    composition = parse([*CAMERAS, *METRICS, *JOINTS], USUAL, "Run a whole head in one process.", args)
    images = LocalImages()
    cameras = [
        composition.maker(name, CameraNode, f"__ns:={composition.namespace}/{eye}", images=images)
        for name, eye in CAMERAS.items()
        if name in composition.own
    ]
    joints = [composition.maker(name, make) for name, make in JOINTS.items() if name in composition.own]
    return run_nodes([*cameras, *metric_makers(composition, images), *joints], composition.common)
