"""gaze_controller_node as a real node, against the fake head behind the topics of the contract.

Head and controller run in lockstep on a clock of the test's own: a slow machine takes longer, and that is all.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PointStamped
from rclpy.action import ActionClient
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool, Trigger

from vergence_gaze.ros.gaze_controller_node import GazeControllerNode
from vergence_gaze.testing.fake_head import FakeHead
from vergence_gaze.testing.ros.head_node import FOCAL_PX, HeadNode
from vergence_msgs.action import LookAt
from vergence_msgs.msg import DetectorClasses, GazeGoal, GazeState
from vergence_rig.rig import JOINT_NAMES, default_rig

pytestmark = pytest.mark.graph

WAIT_S = 100.0
ENDLESS_S = 600.0


class Scene:
    """The controller, the head, and what a client sees of them, on the test's graph."""

    def __init__(self, graph: Any, target_m: Callable[[float], Any]) -> None:
        graph.timeout_s = WAIT_S
        self._graph, self.client = graph, graph.client
        self.head = FakeHead(default_rig(), target_m, start_rad={"pan_right": 0.05}, seed=1)
        self.head_node: HeadNode = graph.add(HeadNode(self.head, graph.context))
        self.node: GazeControllerNode = graph.start(GazeControllerNode, use_sim_time=True)
        self.states: list[GazeState] = []
        self.client.create_subscription(GazeState, "gaze/state", self.states.append, 10)
        self.goals: list[GazeGoal] = []
        self.client.create_subscription(GazeGoal, "gaze/goal", self.goals.append, 10)
        self.look_at = ActionClient(self.client, LookAt, "gaze/look_at")
        self.until(lambda: bool(self.states) and math.isfinite(self.states[-1].tilt_rad), "the joints are known")
        self.until(self.look_at.server_is_ready, "the action server is there")

    def until(self, condition: Callable[[], bool], what: str) -> None:
        """Spin until `condition` holds."""
        self._graph.wait_until(condition, what)

    def diagnostic(self, wanted: Callable[[DiagnosticStatus], bool]) -> None:
        """Wait for a report of the controller's own that is wanted."""
        self._graph.diagnostic(": gaze", wanted)

    def pass_cycles(self, count: int) -> None:
        """Spin until the controller has gone through so many cycles more."""
        enough = len(self.states) + count
        self.until(lambda: len(self.states) >= enough, f"{count} cycles pass")

    def send(self, goal: LookAt.Goal, feedback: list[Any] | None = None) -> Any:
        """Send a goal and return its handle."""
        callback = None if feedback is None else (lambda message: feedback.append(message.feedback))
        return self._graph.wait(self.look_at.send_goal_async(goal, feedback_callback=callback))

    def result(self, handle: Any) -> LookAt.Result:
        """Wait for a goal's result."""
        return self._graph.wait(handle.get_result_async()).result

    def rejection(self, goal: LookAt.Goal) -> GazeGoal:
        """Send a goal that is rejected, and return what gaze/goal says of it."""
        before = len(self.goals)
        assert not self.send(goal).accepted
        self.until(lambda: len(self.goals) > before, "gaze/goal says why")
        assert self.goals[-1].state == GazeGoal.REJECTED
        return self.goals[-1]

    def cancel(self, handle: Any) -> None:
        """Ask for a goal to be cancelled."""
        self._graph.wait(handle.cancel_goal_async())

    def call(self, kind: Any, name: str, request: Any) -> Any:
        """Call a service of the controller's and return the response."""
        service = self.client.create_client(kind, f"gaze_controller_node/{name}")
        self.until(service.service_is_ready, f"{name} is there")
        return self._graph.wait(service.call_async(request))

    def pixel_goal(self, **fields: Any) -> LookAt.Goal:
        """A click on the target in the left eye, as it is seen now."""
        x, y = self.head.project(self.head.target(self.head.time_s), left=True)
        goal = LookAt.Goal(
            kind=LookAt.Goal.PIXEL, left_x_px=319.5 + FOCAL_PX * x, left_y_px=239.5 + FOCAL_PX * y, **fields
        )
        goal.header.stamp = self.head_node.now
        return goal


def still(time_s: float) -> Any:
    return np.array([0.6, 0.1, 0.05])


@pytest.fixture
def scene(graph: Any) -> Scene:
    return Scene(graph, still)


NOTHING_LIKE_IT = LookAt.Goal(kind=LookAt.Goal.CLASS, class_name="nothing like it", time_limit_s=ENDLESS_S)


def test_a_click_ends_verged_and_is_held(scene: Scene) -> None:
    feedback: list[Any] = []
    result = scene.result(scene.send(scene.pixel_goal(), feedback))
    assert result.result == LookAt.Result.VERGED, result.reason
    assert np.abs(np.degrees(scene.head.true_errors_rad())).max() < 0.75
    assert math.degrees(result.vergence_rad) == pytest.approx(6.1, abs=1.0)
    assert result.fixation_point.header.frame_id == "rig_base"
    assert feedback
    assert feedback[0].phase_name in ("saccade", "verge")
    scene.until(lambda: scene.states[-1].phase == GazeState.PHASE_FIXATE, "the target is fixated")
    assert scene.states[-1].verged
    assert scene.states[-1].distance_m == pytest.approx(0.61, rel=0.2)


def test_a_goal_is_published_when_it_starts_and_when_it_ends(scene: Scene) -> None:
    goal = scene.pixel_goal()
    handle = scene.send(goal)
    result = scene.result(handle)
    scene.until(lambda: len(scene.goals) >= 2, "gaze/goal has both")
    started, ended = scene.goals[:2]
    assert (started.state, ended.state) == (GazeGoal.ACTIVE, GazeGoal.ENDED)
    for one in (started, ended):
        assert bytes(one.uuid) == bytes(handle.goal_id.uuid)
        assert (one.kind, one.left_x_px, one.image_stamp) == (goal.kind, goal.left_x_px, goal.header.stamp)
        assert one.request.startswith("pixel (")
    assert (ended.result, ended.reason, ended.time_s) == (result.result, result.reason, result.time_s)


def test_a_new_goal_preempts_the_old(scene: Scene) -> None:
    first = scene.send(NOTHING_LIKE_IT)
    second = scene.send(scene.pixel_goal())
    assert scene.result(first).result == LookAt.Result.PREEMPTED
    assert scene.result(second).result == LookAt.Result.VERGED


def test_cancel_stop_and_disable_hold_the_eyes(scene: Scene) -> None:
    handle = scene.send(NOTHING_LIKE_IT)
    scene.cancel(handle)
    assert scene.result(handle).result == LookAt.Result.CANCELLED
    handle = scene.send(NOTHING_LIKE_IT)
    assert scene.call(Trigger, "stop", Trigger.Request()).success
    assert scene.result(handle).result == LookAt.Result.CANCELLED
    scene.until(lambda: scene.states[-1].phase == GazeState.PHASE_IDLE, "the controller is idle")
    assert scene.call(SetBool, "enable", SetBool.Request(data=False)).success
    scene.pass_cycles(3)  # what was sent before has arrived then
    sent = len(scene.head_node.commands)
    result = scene.rejection(LookAt.Goal(kind=LookAt.Goal.ANGLES, vergence_rad=0.1))
    assert (result.result, "disabled" in result.reason) == (LookAt.Result.INVALID, True)
    scene.pass_cycles(3)
    assert len(scene.head_node.commands) == sent


def test_goals_that_cannot_be_say_why(scene: Scene) -> None:
    behind = LookAt.Goal(kind=LookAt.Goal.POINT)
    behind.point.x, behind.point.y = -1.0, 0.2
    result = scene.rejection(behind)
    assert result.result == LookAt.Result.UNREACHABLE
    assert "must be" in result.reason
    elsewhere = LookAt.Goal(kind=LookAt.Goal.POINT)
    elsewhere.header.frame_id = "moon"
    assert result.request == "point (-1.000, 0.200, 0.000) m in rig_base"
    result = scene.rejection(elsewhere)
    assert result.result == LookAt.Result.INVALID
    assert "moon" in result.reason
    assert scene.rejection(LookAt.Goal(kind=99)).result == LookAt.Result.INVALID


@pytest.mark.parametrize("limit_s", [600.5, 1e9, -1.0, math.inf, math.nan])
def test_a_time_limit_without_bounds_is_refused(scene: Scene, limit_s: float) -> None:
    result = scene.rejection(scene.pixel_goal(time_limit_s=limit_s))
    assert result.result == LookAt.Result.INVALID
    assert result.reason == f"time_limit_s must be 0 (default) to 600 [s]: got {limit_s!r}"


def test_a_class_that_the_detector_does_not_look_for_is_refused_at_once(scene: Scene) -> None:
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    detector = scene.client.create_publisher(DetectorClasses, "vergence/detector_classes", latched)
    detector.publish(DetectorClasses(names=["ball", "cube", "cup"]))
    scene.until(lambda: scene.node._look_at.classes is not None, "the classes are known")
    result = scene.rejection(LookAt.Goal(kind=LookAt.Goal.CLASS, class_name="cub", time_limit_s=ENDLESS_S))
    assert result.result == LookAt.Result.INVALID
    assert result.reason == "class_name must be one that the detector looks for (cube, ball, cup): got 'cub'"
    result = scene.rejection(LookAt.Goal(kind=LookAt.Goal.CLASS, class_name="face", time_limit_s=ENDLESS_S))
    assert result.result == LookAt.Result.INVALID
    assert "got 'face'; faces need YuNet: the file face_detection_yunet_2023mar.onnx" in result.reason
    handle = scene.send(LookAt.Goal(kind=LookAt.Goal.CLASS, class_name="cube", time_limit_s=ENDLESS_S))
    scene.until(lambda: scene.states[-1].phase == GazeState.PHASE_SEARCH, "the class is searched for")
    scene.cancel(handle)
    assert scene.result(handle).result == LookAt.Result.CANCELLED


def test_a_face_that_nothing_detects_ends_with_what_is_missing(scene: Scene) -> None:
    result = scene.result(scene.send(LookAt.Goal(kind=LookAt.Goal.CLASS, class_name="face", time_limit_s=0.5)))
    assert result.result in (LookAt.Result.TIMED_OUT, LookAt.Result.LOST)
    assert "box_metric_node must run; faces need YuNet" in result.reason


def test_angles_are_reached_exactly(scene: Scene) -> None:
    goal = LookAt.Goal(kind=LookAt.Goal.ANGLES, version_rad=0.1, vergence_rad=math.radians(20), tilt_rad=-0.1)
    assert scene.result(scene.send(goal)).result == LookAt.Result.VERGED
    half = math.radians(10)
    np.testing.assert_allclose(scene.head_node.commands[-1], [0.1 - half, 0.1 + half, -0.1], atol=1e-6)


def test_a_streamed_target_is_followed(scene: Scene) -> None:
    targets = scene.client.create_publisher(PointStamped, "gaze/target", 10)

    def publish(state: GazeState) -> None:
        message = PointStamped()
        message.header.frame_id = "rig_base"
        message.header.stamp = scene.head_node.now
        message.point.x, message.point.y, message.point.z = (float(v) for v in still(0.0))
        targets.publish(message)

    scene.client.create_subscription(GazeState, "gaze/state", publish, 10)
    scene.until(lambda: scene.states[-1].phase == GazeState.PHASE_FIXATE, "the streamed target is fixated")
    assert np.abs(np.degrees(scene.head.true_errors_rad())).max() < 1.5


def test_parameters_are_taken_at_run_time_and_refused_when_wrong(scene: Scene) -> None:
    good, bad = scene.node.set_parameters(
        [Parameter("mode", value="left_held"), Parameter("saccade.threshold_rad", value=-1.0)]
    )
    assert good.successful
    assert not bad.successful
    assert "saccade.threshold_rad" in bad.reason
    scene.until(lambda: scene.states[-1].mode == "left_held", "the mode is taken")


def test_the_servos_real_resolution_is_used(scene: Scene) -> None:
    described = scene.node.resolution_rad
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    resolution = scene.client.create_publisher(JointState, "servo_node/resolution", latched)
    resolution.publish(JointState(name=list(JOINT_NAMES), position=[0.0077] * 3))
    scene.until(lambda: scene.node.resolution_rad != described, "the resolution is taken")
    assert scene.node.resolution_rad == pytest.approx([0.0077] * 3)
    result = scene.result(scene.send(scene.pixel_goal()))
    assert result.result == LookAt.Result.VERGED, result.reason
    scene.until(lambda: scene.states[-1].phase == GazeState.PHASE_FIXATE, "the target is fixated")
    scene.pass_cycles(50)
    before = len(scene.head_node.commands)
    scene.pass_cycles(50)
    assert np.ptp(scene.head_node.commands[before:], axis=0).max() < 0.0077


def test_joint_states_that_stop_are_named_and_the_search_stops(scene: Scene) -> None:
    handle = scene.send(LookAt.Goal(kind=LookAt.Goal.CLASS, class_name="cup", time_limit_s=ENDLESS_S))
    scene.until(lambda: scene.states[-1].phase == GazeState.PHASE_SEARCH, "the search begins")
    scene.head_node.silent.add("joints")
    scene.until(lambda: "joint_states have stopped" in scene.states[-1].reason, "the reason is named")
    scene.pass_cycles(5)  # what was sent before has arrived then
    sent = len(scene.head_node.commands)
    result = scene.result(handle)
    assert (result.result, "joint_states have stopped" in result.reason) == (LookAt.Result.NO_FEEDBACK, True)
    assert np.ptp(scene.head_node.commands[sent:], axis=0).max() == 0.0
    scene.diagnostic(lambda s: s.level == DiagnosticStatus.ERROR and "joint_states have stopped" in s.message)
    scene.head_node.silent.clear()
    scene.until(lambda: "joint_states" not in scene.states[-1].reason, "the fault has ended")
    assert scene.result(scene.send(scene.pixel_goal())).result == LookAt.Result.VERGED


def test_the_diagnostic_is_not_ok_without_results_from_images(scene: Scene) -> None:
    scene.result(scene.send(scene.pixel_goal()))
    scene.diagnostic(lambda s: s.level == DiagnosticStatus.OK)
    scene.head_node.silent.add("images")
    scene.diagnostic(lambda s: s.level == DiagnosticStatus.WARN and "no results from the images arrive" in s.message)
    assert not scene.states[-1].verged
    scene.head_node.silent.clear()
    scene.diagnostic(lambda s: s.level == DiagnosticStatus.OK)


def test_on_unusable_images_the_eyes_are_not_verged_and_the_cause_is_named(scene: Scene) -> None:
    assert scene.result(scene.send(scene.pixel_goal())).result == LookAt.Result.VERGED
    scene.head_node.images_fault = "the left image is frozen"
    scene.until(lambda: not scene.states[-1].verged, "the eyes are no longer verged")
    begin = len(scene.states)
    scene.diagnostic(lambda s: s.level == DiagnosticStatus.ERROR and "the left image is frozen" in s.message)
    assert "the left image is frozen" in scene.states[-1].reason
    result = scene.result(scene.send(scene.pixel_goal()))
    assert (result.result, result.reason) == (LookAt.Result.NO_IMAGES, "the left image is frozen")
    assert not any(state.verged for state in scene.states[begin:])
    scene.head_node.images_fault = ""
    assert scene.result(scene.send(scene.pixel_goal())).result == LookAt.Result.VERGED
