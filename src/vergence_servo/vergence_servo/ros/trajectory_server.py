"""The standard action control_msgs/FollowJointTrajectory on servo_node, where control_msgs is installed."""

from collections.abc import Callable, Mapping
from typing import Any

from rclpy.action import ActionServer, CancelResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.node import Node
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from vergence_servo.command_guard import (
    CommandRefusedError,
    MalformedCommandError,
    StaleCommandError,
    UnknownJointError,
)
from vergence_servo.ros.servo_messages import duration_s
from vergence_servo.servo_head import Mode, ServoHead
from vergence_servo.trajectory_goal import LATE_S, Ending, Tolerances, TrajectoryGoal, tolerance_rad

NAME = "~/follow_joint_trajectory"
Start = Callable[[JointTrajectory], float]
"""Checks a trajectory, lets the servos follow it, and returns when it begins on time.monotonic [s]."""

_FEEDBACK_EVERY_S = 0.05


def make_trajectory_server(node: Node, head: ServoHead, start: Start) -> "TrajectoryServer | None":
    """Return the server, None where control_msgs is not installed."""
    try:
        from control_msgs.action import FollowJointTrajectory
    except ImportError:
        return None
    return TrajectoryServer(node, head, start, FollowJointTrajectory)


class TrajectoryServer:
    """Follows one trajectory at a time; any other command ends it. `update` is to be called after every step."""

    def __init__(self, node: Node, head: ServoHead, start: Start, action: Any) -> None:
        self._node, self._head, self._start, self._action = node, head, start, action
        self._active: tuple[TrajectoryGoal, ServerGoalHandle] | None = None
        self._endings: dict[bytes, tuple[Ending, str]] = {}
        self._fed_back_s = 0.0
        self._server = ActionServer(
            node,
            action,
            NAME,
            execute_callback=self._execute,
            handle_accepted_callback=self._on_accepted,
            cancel_callback=lambda handle: CancelResponse.ACCEPT,
        )

    def update(self, now_s: float) -> None:
        """End the goal if it has ended, or give feedback."""
        if self._active is None:
            return
        goal, handle = self._active
        if handle.is_cancel_requested:
            self._head.hold(now_s)
            self._end(handle, Ending.SUCCESSFUL, "cancelled: the servos hold where they are")
            return
        # After the last command's time-out the head holds what the trajectory has reached.
        at_rest = now_s >= goal.end_s and self._head.mode is Mode.HOLDING
        if self._head.trajectory is not goal.trajectory and not at_rest:
            self._end(handle, Ending.INVALID_GOAL, "another command, a stop or a fault of the servos took its place")
            return
        positions = self._head.positions_rad(now_s)
        ending = goal.update(now_s, positions)
        if ending is not None:
            if ending[0] is not Ending.SUCCESSFUL:
                self._head.hold(now_s)
            self._end(handle, *ending)
        elif now_s - self._fed_back_s >= _FEEDBACK_EVERY_S:
            self._fed_back_s = now_s
            handle.publish_feedback(self._feedback(goal, now_s, positions))

    def _on_accepted(self, handle: ServerGoalHandle) -> None:
        try:
            tolerances = _tolerances(handle.request, tuple(self._head.channels))
        except ValueError as error:
            self._node.get_logger().warning(f"{NAME} refused: {error}")
            self._refuse(handle, error)
            return
        try:
            begin_s = self._start(handle.request.trajectory)
        except CommandRefusedError as error:  # counted and logged there
            self._refuse(handle, error)
            return
        if self._active is not None:
            self._end(self._active[1], Ending.INVALID_GOAL, "another trajectory took its place")
        trajectory = self._head.trajectory
        assert trajectory is not None
        self._active = TrajectoryGoal(trajectory, begin_s, tolerances), handle

    def _refuse(self, handle: ServerGoalHandle, error: ValueError) -> None:
        codes = ((UnknownJointError, Ending.INVALID_JOINTS), (StaleCommandError, Ending.OLD_HEADER_TIMESTAMP))
        code = next((code for kind, code in codes if isinstance(error, kind)), Ending.INVALID_GOAL)
        self._endings[bytes(handle.goal_id.uuid)] = code, str(error)
        handle.execute()

    def _end(self, handle: ServerGoalHandle, ending: Ending, reason: str) -> None:
        self._active = None
        self._endings[bytes(handle.goal_id.uuid)] = ending, reason
        handle.execute()

    def _execute(self, handle: ServerGoalHandle) -> Any:
        """Return the result of a goal that has ended."""
        ending, reason = self._endings.pop(bytes(handle.goal_id.uuid))
        if handle.is_cancel_requested:
            handle.canceled()
        elif ending is Ending.SUCCESSFUL:
            handle.succeed()
        else:
            handle.abort()
        return self._action.Result(error_code=int(ending), error_string=reason)

    def _feedback(self, goal: TrajectoryGoal, now_s: float, positions_rad: Mapping[str, float]) -> Any:
        errors = goal.errors(now_s, positions_rad)
        feedback = self._action.Feedback(joint_names=list(errors.desired_rad))
        feedback.header.stamp = self._node.get_clock().now().to_msg()
        feedback.desired = _point(errors.desired_rad)
        feedback.actual = _point(errors.actual_rad)
        feedback.error = _point(errors.error_rad)
        return feedback


def _point(positions_rad: Mapping[str, float]) -> JointTrajectoryPoint:
    return JointTrajectoryPoint(positions=list(positions_rad.values()))


def _tolerances(request: Any, known: tuple[str, ...]) -> Tolerances:
    """Return a request's tolerances. Raises UnknownJointError, or ValueError for a value that is no tolerance."""
    by_place: list[dict[str, float]] = []
    for given in (request.path_tolerance, request.goal_tolerance):
        values: dict[str, float] = {}
        for one in given:
            if one.name not in known:
                raise UnknownJointError(f"joint must be one of {', '.join(known)}: got {one.name[:60]!r}")
            value_rad = tolerance_rad(one.position)
            if value_rad is not None:
                values[one.name] = value_rad
        by_place.append(values)
    late_s = duration_s(request.goal_time_tolerance)
    if late_s < 0:
        raise MalformedCommandError(f"goal_time_tolerance must be 0 for the default or more [s]: got {late_s:g}")
    path_rad, goal_rad = by_place
    return Tolerances(path_rad, goal_rad, late_s or LATE_S)
