"""gaze_controller_node attends without a goal: persons before the fake head, on the topics of the contract."""

from typing import Any

import numpy as np
import pytest
from rclpy.action import ActionClient
from std_msgs.msg import String
from std_srvs.srv import Trigger

from vergence_gaze.goals.goal import ObjectRequest
from vergence_gaze.ros.gaze_controller_node import GazeControllerNode
from vergence_gaze.testing.fake_head import TARGET_ID, FakeHead, VisionModel
from vergence_gaze.testing.ros.head_node import HeadNode
from vergence_msgs.action import LookAt
from vergence_msgs.msg import GazeState
from vergence_rig.rig import default_rig

pytestmark = pytest.mark.graph

OTHER_ID = 4
PLACE, BESIDE = np.array([0.9, 0.15, 0.0]), np.array([1.1, -0.3, 0.05])


class People:
    """Two persons that cross, the head, and a controller that attends."""

    def __init__(self, graph: Any, **parameters: Any) -> None:
        graph.timeout_s = 100.0
        self.graph = graph
        path = {TARGET_ID: lambda time_s: PLACE, OTHER_ID: lambda time_s: BESIDE}
        self.head = FakeHead(
            default_rig(),
            path[TARGET_ID],
            VisionModel(boxes=True),
            class_name="face",
            others={OTHER_ID: ("face", path[OTHER_ID])},
        )
        self.node = graph.add(HeadNode(self.head, graph.context))
        self.states: list[GazeState] = []
        graph.client.create_subscription(GazeState, "gaze/state", self.states.append, 10)
        self.policies = graph.client.create_publisher(String, "gaze/attention", 10)
        graph.start(GazeControllerNode, use_sim_time=True, start="attend", **parameters)

    def until_verged_on(self, object_id: int) -> None:
        self.graph.wait_until(
            lambda: self.states and self.states[-1].verged and self.error_deg(object_id) < 1.0,
            f"the eyes are verged on object {object_id}",
        )

    def error_deg(self, object_id: int) -> float:
        return float(np.degrees(np.abs(self.head.true_errors_rad(object_id)).max()))

    def set_policy(self, policy: str) -> None:
        self.graph.wait_until(lambda: self.policies.get_subscription_count() > 0, "the controller subscribes")
        self.policies.publish(String(data=policy))


def test_it_looks_at_a_face_glances_at_the_other_and_returns(graph: Any) -> None:
    people = People(graph, **{"attention.glance_every_s": 1.0})
    people.until_verged_on(TARGET_ID)
    assert ObjectRequest("face") in people.node.object_requests
    people.until_verged_on(OTHER_ID)
    assert ObjectRequest("face", OTHER_ID) in people.node.object_requests
    assert any(f"a glance at object {OTHER_ID} (face)" in state.attention for state in people.states)
    people.until_verged_on(TARGET_ID)


def test_a_goal_wins_and_a_policy_can_be_set(graph: Any) -> None:
    people = People(graph, **{"attention.glance_every_s": 0.0})
    people.until_verged_on(TARGET_ID)
    look_at = ActionClient(graph.client, LookAt, "gaze/look_at")
    graph.wait_until(look_at.server_is_ready, "the action server is there")
    goal = LookAt.Goal(kind=LookAt.Goal.ANGLES, version_rad=0.6, vergence_rad=0.05)
    handle = graph.wait(look_at.send_goal_async(goal))
    assert graph.wait(handle.get_result_async()).result.result == LookAt.Result.VERGED
    assert "waiting" in people.states[-1].attention
    people.until_verged_on(TARGET_ID)
    people.set_policy("disabled")
    graph.wait_until(lambda: people.states[-1].phase == GazeState.PHASE_IDLE, "the eyes hold still")
    assert people.states[-1].attention == "disabled"
    people.set_policy("nonsense")
    people.set_policy("focused")
    people.until_verged_on(TARGET_ID)
    assert people.states[-1].attention.startswith("focused: ")


def test_stop_holds_the_eyes(graph: Any) -> None:
    people = People(graph)
    people.until_verged_on(TARGET_ID)
    stop = graph.client.create_client(Trigger, "gaze_controller_node/stop")
    graph.wait_until(stop.service_is_ready, "the service is there")
    assert graph.wait(stop.call_async(Trigger.Request())).success
    graph.wait_until(lambda: people.states[-1].phase == GazeState.PHASE_IDLE, "the controller is idle")
    assert people.states[-1].reason == "stopped on request"
