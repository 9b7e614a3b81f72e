"""gaze_controller_node as a real node, against the fake head behind the topics of the contract."""

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
import rclpy
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PointStamped
from rclpy.action import ActionClient
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.task import Future
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool, Trigger

from vergence_common.stamps import to_stamp
from vergence_msgs.action import LookAt
from vergence_msgs.msg import EdgeVergence, GazeState, TargetTrack, VergenceError
from vergence_rig.rig import JOINT_NAMES, default_rig
from vergence_servo.gaze.fake_head import TICK_S, FakeHead
from vergence_servo.gaze.observations import EdgeJudgement, FoveaDisparity, JointReport, TrackSighting
from vergence_servo.gaze_controller_node import GazeControllerNode

pytestmark = pytest.mark.graph

WAIT_S = 20.0
FOCAL_PX = 539.0


class HeadNode(Node):
    """The fake head on the topics of sim_node and edge_metric_node, in real time."""

    def __init__(self, head: FakeHead, context: Context) -> None:
        super().__init__("head", context=context)
        self.head = head
        self._start_s = self.get_clock().now().nanoseconds * 1e-9
        self._joints = self.create_publisher(JointState, "joint_states", 10)
        self._edge = self.create_publisher(EdgeVergence, "vergence/edge", 10)
        self._error = self.create_publisher(VergenceError, "vergence/error", 10)
        self._track = self.create_publisher(TargetTrack, "vergence/track", 10)
        self.commands: list[list[float]] = []
        self.create_subscription(JointState, "joint_command", self._on_command, 10)
        self.create_timer(0.01, self._tick)

    def _on_command(self, message: JointState) -> None:
        by_name = dict(zip(message.name, message.position, strict=True))
        self.commands.append([by_name[name] for name in JOINT_NAMES])
        self.head.command(np.array(self.commands[-1]))

    def _tick(self) -> None:
        elapsed_s = self.get_clock().now().nanoseconds * 1e-9 - self._start_s
        while self.head.time_s + TICK_S <= elapsed_s:
            for observation in self.head.advance():
                self._publish(observation)

    def _stamp(self, head_s: float) -> Time:
        return to_stamp(self._start_s + head_s)

    def _publish(self, seen: object) -> None:
        if isinstance(seen, JointReport):
            message = JointState(name=list(seen.positions_rad), position=list(seen.positions_rad.values()))
            message.header.stamp = self._stamp(seen.stamp_s)
            self._joints.publish(message)
        elif isinstance(seen, EdgeJudgement):
            edge = EdgeVergence(windows_px=[50, 300], contrast=[seen.contrast, 1.0])
            edge.left_to_right_px = edge.right_to_left_px = [seen.metric_px, 9.0]
            edge.header.stamp = self._stamp(seen.stamp_s)
            self._edge.publish(edge)
        elif isinstance(seen, FoveaDisparity):
            error = VergenceError(
                pair_skew_s=seen.skew_s,
                horizontal_rad=seen.horizontal_rad,
                sigma_px=seen.sigma_rad * FOCAL_PX,
                confidence=seen.confidence,
                status=VergenceError.STATUS_OK if seen.usable else VergenceError.STATUS_NO_MATCH,
            )
            error.header.stamp = self._stamp(seen.stamp_s)
            self._error.publish(error)
        elif isinstance(seen, TrackSighting):
            track = TargetTrack(
                pair_skew_s=seen.skew_s,
                track_id=seen.track_id,
                left_x_px=319.5 + FOCAL_PX * seen.left_x,
                left_y_px=239.5 + FOCAL_PX * seen.left_y,
                disparity_rad=seen.disparity_rad,
                sigma_px=seen.sigma_rad * FOCAL_PX,
                status=TargetTrack.STATUS_OK if seen.usable else TargetTrack.STATUS_LOCKING,
            )
            track.header.stamp = self._stamp(seen.stamp_s)
            self._track.publish(track)


class Graph:
    """The controller and the head on one executor, and what a client sees of them."""

    def __init__(self, target_m: Callable[[float], Any], overrides: dict[str, Any] | None = None) -> None:
        self.context = Context()
        rclpy.init(context=self.context)
        parameters = [Parameter(name, value=value) for name, value in (overrides or {}).items()]
        self.head = FakeHead(default_rig(), target_m, start_rad={"pan_right": 0.05}, seed=1)
        self.head_node = HeadNode(self.head, self.context)
        self.node = GazeControllerNode(context=self.context, parameter_overrides=parameters)
        self.client = Node("client", context=self.context)
        self.states: list[GazeState] = []
        self.client.create_subscription(GazeState, "gaze/state", self.states.append, 10)
        self.look_at = ActionClient(self.client, LookAt, "gaze/look_at")
        self.executor = SingleThreadedExecutor(context=self.context)
        for node in (self.head_node, self.node, self.client):
            self.executor.add_node(node)
        self.until(lambda: bool(self.states) and math.isfinite(self.states[-1].tilt_rad))
        assert self.look_at.wait_for_server(timeout_sec=WAIT_S)

    def until(self, condition: Callable[[], bool]) -> None:
        """Spin until `condition` holds."""
        done = Future(executor=self.executor)
        watch = self.client.create_timer(0.005, lambda: done.set_result(True) if condition() else None)
        self.executor.spin_until_future_complete(done, timeout_sec=WAIT_S)
        self.client.destroy_timer(watch)
        assert done.done(), "the condition never held"

    def get(self, future: Future) -> Any:
        """Spin until a future is done and return its result."""
        self.executor.spin_until_future_complete(future, timeout_sec=WAIT_S)
        assert future.done()
        return future.result()

    def send(self, goal: LookAt.Goal, feedback: list[Any] | None = None) -> Any:
        """Send a goal and return its handle."""
        callback = None if feedback is None else (lambda message: feedback.append(message.feedback))
        return self.get(self.look_at.send_goal_async(goal, feedback_callback=callback))

    def result(self, handle: Any) -> LookAt.Result:
        """Wait for a goal's result."""
        return self.get(handle.get_result_async()).result

    def pixel_goal(self, **fields: Any) -> LookAt.Goal:
        """A click on the target in the left eye."""
        x, y = self.head.project(self.head.target(self.head.time_s), left=True)
        return LookAt.Goal(
            kind=LookAt.Goal.PIXEL, left_x_px=319.5 + FOCAL_PX * x, left_y_px=239.5 + FOCAL_PX * y, **fields
        )

    def close(self) -> None:
        """Take everything down."""
        self.executor.shutdown()
        for node in (self.head_node, self.node, self.client):
            node.destroy_node()
        rclpy.try_shutdown(context=self.context)


def still(time_s: float) -> Any:
    return np.array([0.6, 0.1, 0.05])


@pytest.fixture
def graph(domain_id: int) -> Iterator[Graph]:
    made = Graph(still)
    yield made
    made.close()


def test_a_click_ends_verged_and_is_held(graph: Graph) -> None:
    feedback: list[Any] = []
    result = graph.result(graph.send(graph.pixel_goal(), feedback))
    assert result.result == LookAt.Result.VERGED, result.reason
    assert np.abs(np.degrees(graph.head.true_errors_rad())).max() < 0.75
    assert math.degrees(result.vergence_rad) == pytest.approx(6.1, abs=1.0)
    assert result.fixation_point.header.frame_id == "rig_base"
    assert feedback
    assert feedback[0].phase_name in ("saccade", "verge")
    graph.until(lambda: graph.states[-1].phase == GazeState.PHASE_FIXATE)
    assert graph.states[-1].verged
    assert graph.states[-1].distance_m == pytest.approx(0.61, rel=0.2)


def test_a_new_goal_preempts_the_old(graph: Graph) -> None:
    first = graph.send(LookAt.Goal(kind=LookAt.Goal.CLASS, class_name="nothing like it"))
    second = graph.send(graph.pixel_goal())
    assert graph.result(first).result == LookAt.Result.PREEMPTED
    assert graph.result(second).result == LookAt.Result.VERGED


def test_cancel_stop_and_disable_hold_the_eyes(graph: Graph) -> None:
    handle = graph.send(LookAt.Goal(kind=LookAt.Goal.CLASS, class_name="nothing like it"))
    graph.get(handle.cancel_goal_async())
    assert graph.result(handle).result == LookAt.Result.CANCELLED
    handle = graph.send(LookAt.Goal(kind=LookAt.Goal.CLASS, class_name="nothing like it"))
    stop = graph.client.create_client(Trigger, "gaze_controller_node/stop")
    assert stop.wait_for_service(WAIT_S)
    assert graph.get(stop.call_async(Trigger.Request())).success
    assert graph.result(handle).result == LookAt.Result.CANCELLED
    graph.until(lambda: graph.states[-1].phase == GazeState.PHASE_IDLE)
    enable = graph.client.create_client(SetBool, "gaze_controller_node/enable")
    assert enable.wait_for_service(WAIT_S)
    assert graph.get(enable.call_async(SetBool.Request(data=False))).success
    sent = len(graph.head_node.commands)
    result = graph.result(graph.send(LookAt.Goal(kind=LookAt.Goal.ANGLES, vergence_rad=0.1)))
    assert (result.result, "disabled" in result.reason) == (LookAt.Result.INVALID, True)
    assert len(graph.head_node.commands) == sent


def test_goals_that_cannot_be_say_why(graph: Graph) -> None:
    behind = LookAt.Goal(kind=LookAt.Goal.POINT)
    behind.point.x, behind.point.y = -1.0, 0.2
    result = graph.result(graph.send(behind))
    assert result.result == LookAt.Result.UNREACHABLE
    assert "allowed is" in result.reason
    elsewhere = LookAt.Goal(kind=LookAt.Goal.POINT)
    elsewhere.header.frame_id = "moon"
    result = graph.result(graph.send(elsewhere))
    assert result.result == LookAt.Result.INVALID
    assert "moon" in result.reason
    assert graph.result(graph.send(LookAt.Goal(kind=99))).result == LookAt.Result.INVALID


def test_angles_are_reached_exactly(graph: Graph) -> None:
    goal = LookAt.Goal(kind=LookAt.Goal.ANGLES, version_rad=0.1, vergence_rad=math.radians(20), tilt_rad=-0.1)
    assert graph.result(graph.send(goal)).result == LookAt.Result.VERGED
    half = math.radians(10)
    np.testing.assert_allclose(graph.head_node.commands[-1], [0.1 - half, 0.1 + half, -0.1], atol=1e-6)


def test_a_streamed_target_is_followed(graph: Graph) -> None:
    targets = graph.client.create_publisher(PointStamped, "gaze/target", 10)

    def publish() -> None:
        message = PointStamped()
        message.header.frame_id = "rig_base"
        message.header.stamp = graph.client.get_clock().now().to_msg()
        message.point.x, message.point.y, message.point.z = (float(v) for v in still(0.0))
        targets.publish(message)

    graph.client.create_timer(0.03, publish)
    graph.until(lambda: graph.states[-1].phase == GazeState.PHASE_FIXATE)
    assert np.abs(np.degrees(graph.head.true_errors_rad())).max() < 1.5


def test_parameters_are_taken_at_run_time_and_refused_when_wrong(graph: Graph) -> None:
    good, bad = graph.node.set_parameters(
        [Parameter("mode", value="left_held"), Parameter("saccade_threshold_rad", value=-1.0)]
    )
    assert good.successful
    assert not bad.successful
    assert "saccade_threshold_rad" in bad.reason
    graph.until(lambda: graph.states[-1].mode == "left_held")
