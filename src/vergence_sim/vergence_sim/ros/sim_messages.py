"""Converts the simulator's values to messages."""

from collections.abc import Mapping

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point
from sensor_msgs.msg import CameraInfo, JointState
from std_msgs.msg import Header

from vergence_msgs.msg import BoundingBox, TrueBoxes, TrueVergence
from vergence_rig.rig import CameraSpec
from vergence_sim.truth import TrueBox, Truth


def joint_state(stamp: Time, angles_rad: Mapping[str, float], speeds_rad_s: Mapping[str, float]) -> JointState:
    """Return joint angles and speeds by name."""
    return JointState(
        header=Header(stamp=stamp, frame_id="rig_base"),
        name=list(angles_rad),
        position=list(angles_rad.values()),
        velocity=[speeds_rad_s[name] for name in angles_rad],
    )


def camera_info(header: Header, camera: CameraSpec, calibration: CameraSpec | None) -> CameraInfo:
    """Return what a camera says of itself; without a calibration its matrices are 0, as ROS defines it."""
    if calibration is None:
        return CameraInfo(header=header, width=camera.width_px, height=camera.height_px)
    c = calibration
    return CameraInfo(
        header=header,
        width=c.width_px,
        height=c.height_px,
        distortion_model="plumb_bob",
        d=[float(value) for value in c.distortion],
        k=[c.fx_px, 0.0, c.cx_px, 0.0, c.fy_px, c.cy_px, 0.0, 0.0, 1.0],
        r=[float(value) for value in np.eye(3).ravel()],
        p=[c.fx_px, 0.0, c.cx_px, 0.0, 0.0, c.fy_px, c.cy_px, 0.0, 0.0, 0.0, 1.0, 0.0],
    )


def true_vergence(stamp: Time, frame_id: str, truth: Truth) -> TrueVergence:
    """Return the truth as its message."""
    x, y, z = (float(value) for value in truth.target_point_m)
    return TrueVergence(
        header=Header(stamp=stamp, frame_id=frame_id),
        target=truth.target,
        target_point=Point(x=x, y=y, z=z),
        pan_left_rad=truth.pan_left_rad,
        pan_right_rad=truth.pan_right_rad,
        tilt_rad=truth.tilt_rad,
        vergence_error_rad=truth.vergence_error_rad,
        version_error_rad=truth.version_error_rad,
        elevation_error_rad=truth.elevation_error_rad,
        left_error_rad=truth.left_error_rad,
        right_error_rad=truth.right_error_rad,
        left_principal_error_rad=truth.left_principal_error_rad,
        right_principal_error_rad=truth.right_principal_error_rad,
        mean_disparity_px=truth.mean_disparity_px,
        left_visible_share=truth.left_visible_share,
        right_visible_share=truth.right_visible_share,
        left_x_px=truth.left_px[0],
        left_y_px=truth.left_px[1],
        right_x_px=truth.right_px[0],
        right_y_px=truth.right_px[1],
    )


def true_boxes(stamp: Time, frame_id: str, left: list[TrueBox], right: list[TrueBox]) -> TrueBoxes:
    """Return the true boxes of both eyes."""
    return TrueBoxes(
        header=Header(stamp=stamp, frame_id=frame_id),
        left=[_box(box) for box in left],
        right=[_box(box) for box in right],
    )


def _box(box: TrueBox) -> BoundingBox:
    return BoundingBox(
        x_min_px=box.x_min_px,
        y_min_px=box.y_min_px,
        x_max_px=box.x_max_px,
        y_max_px=box.y_max_px,
        score=float("nan"),
        class_id=-1,
        class_name=box.name,
        cut_left=box.cut_left,
        cut_top=box.cut_top,
        cut_right=box.cut_right,
        cut_bottom=box.cut_bottom,
        point_x_px=0.5 * (box.x_min_px + box.x_max_px),
        point_y_px=0.5 * (box.y_min_px + box.y_max_px),
    )
