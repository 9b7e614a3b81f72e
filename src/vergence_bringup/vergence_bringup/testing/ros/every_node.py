"""Every node of the table as a class, with parameters with which it starts without hardware."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from rclpy.node import Node

from vergence_camera.ros.camera_node import CameraNode
from vergence_gaze.ros.gaze_controller_node import GazeControllerNode
from vergence_metric.ros.box_metric_node import BoxMetricNode
from vergence_metric.ros.edge_metric_node import EdgeMetricNode
from vergence_metric.ros.eye_rotation_node import EyeRotationNode
from vergence_servo.ros.servo_node import ServoNode
from vergence_sim.ros.photo_node import PhotoNode
from vergence_sim.ros.sim_node import SimNode
from vergence_web.ros.web_node import WebNode

KINDS: dict[str, Callable[..., Node]] = {
    "box_metric_node": BoxMetricNode,
    "camera_node": CameraNode,
    "edge_metric_node": EdgeMetricNode,
    "eye_rotation_node": EyeRotationNode,
    "gaze_controller_node": GazeControllerNode,
    "photo_node": PhotoNode,
    "servo_node": ServoNode,
    "sim_node": SimNode,
    "web_node": WebNode,
}


def parameters_without_hardware(executable: str, folder: Path) -> dict[str, Any]:
    """Return the parameters with which a node starts without hardware; pictures that it needs are put into `folder`."""
    image = np.random.default_rng(0).integers(0, 255, (120, 160, 3), np.uint8)
    pictures = [folder / "left.png", folder / "right.png"]
    for picture in pictures:
        cv2.imwrite(str(picture), image)
    given: dict[str, dict[str, Any]] = {
        "camera_node": {"device": str(folder), "width_px": 160, "height_px": 120},
        "photo_node": {"left": str(pictures[0]), "right": str(pictures[1])},
        "servo_node": {"backend": "fake", "pose_file": str(folder / "pose.json")},
        "web_node": {"port": 0},
    }
    return given.get(executable, {})
