"""The standard action control_msgs/PointHead as gaze/point_head, where control_msgs is installed."""

import math
from typing import Any

import numpy as np
from rclpy.node import Node

from vergence_common.stamps import to_seconds
from vergence_gaze.control.controller import GazeController
from vergence_gaze.control.report import GazeReport
from vergence_gaze.goals.goal import Goal, GoalKind, Outcome, Result
from vergence_gaze.goals.pointing import check_axis, pointing_error_rad
from vergence_gaze.ros.goal_server import GoalServer
from vergence_gaze.ros.point_frames import PointFrames


def make_point_head_server(node: Node, controller: GazeController, frames: PointFrames) -> GoalServer | None:
    """Return the server, None where control_msgs is not installed."""
    try:
        from control_msgs.action import PointHead
    except ImportError:
        return None
    return PointHeadServer(node, controller, frames, PointHead)


class PointHeadServer(GoalServer):
    """Looks at a point in any frame, with both eyes, no faster than asked and for no less than the asked time."""

    def __init__(self, node: Node, controller: GazeController, frames: PointFrames, action: Any) -> None:
        self._frames, self._action = frames, action
        super().__init__(node, controller, action, "gaze/point_head")

    def _goal(self, request: Any) -> Goal:
        axis = request.pointing_axis
        check_axis(request.pointing_frame, (axis.x, axis.y, axis.z))
        duration = request.min_duration
        return Goal(
            GoalKind.POINT,
            point_m=self._place(request),
            max_speed_rad_s=request.max_velocity or math.inf,
            min_duration_s=duration.sec + duration.nanosec * 1e-9,
            needs_images=False,
        )

    def _place(self, request: Any) -> tuple[float, float, float]:
        header = request.target.header
        return self._frames.in_rig(request.target.point, header.frame_id, to_seconds(header.stamp) or math.nan)

    def _succeeded(self, result: Result) -> bool:
        # It asks for the direction of a point; that something is seen there is more than it asks for.
        return result in (Result.VERGED, Result.AT_POINT)

    def _feedback(self, request: Any, report: GazeReport) -> Any:
        half = 0.5 * report.vergence_rad
        angles = np.array([report.version_rad - half, report.version_rad + half, report.tilt_rad])
        error_rad = pointing_error_rad(
            request.pointing_frame, self._place(request), angles, self._controller.kinematics
        )
        return self._action.Feedback(pointing_angle_error=error_rad)

    def _result(self, outcome: Outcome, report: GazeReport | None) -> Any:
        return self._action.Result()
