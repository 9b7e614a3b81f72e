"""web_node in a graph: it receives nothing without a page, and does what a page asks for."""

import asyncio
import json
import threading
from collections.abc import Awaitable, Callable
from concurrent.futures import Future as ThreadFuture
from typing import Any

import numpy as np
import pytest
from aiohttp import ClientSession, ClientWebSocketResponse, WSMsgType
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import CompressedImage, Image, JointState
from std_msgs.msg import Header
from std_srvs.srv import SetBool, Trigger

from vergence_common.images import array_to_compressed, array_to_image
from vergence_common.qos import IMAGE_QOS
from vergence_common.stamps import from_nanoseconds, to_nanoseconds
from vergence_msgs.action import LookAt
from vergence_msgs.msg import GazeGoal, GazeState
from vergence_web.ros.web_node import WebNode
from vergence_web.update import HEADER

from .conftest import Graph

pytestmark = pytest.mark.graph

STAMP_NS = 1_795_825_253_548_606_464
PICTURE = np.random.default_rng(0).integers(0, 255, (48, 64, 3)).astype(np.uint8)


class Page:
    """A page's WebSocket in a thread of its own, so that the graph can be spun meanwhile."""

    def __init__(self, graph: Graph, node: WebNode) -> None:
        self._graph, self._origin = graph, node.urls[0].rstrip("/")
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)
        self._thread.start()
        self.state: dict[str, Any] = {}
        self.images: dict[str, list[tuple[str, bytes]]] = {"left": [], "right": [], "edges": []}
        self.answers: list[dict[str, Any]] = []
        self.socket: ClientWebSocketResponse = self._do(self._open())
        self._receiving = asyncio.run_coroutine_threadsafe(self._receive(), self._loop)

    async def _open(self) -> ClientWebSocketResponse:
        self._session = ClientSession()
        return await self._session.ws_connect(f"{self._origin}/socket", headers={"Origin": self._origin})

    def _do(self, work: Awaitable[Any]) -> Any:
        future: ThreadFuture[Any] = asyncio.run_coroutine_threadsafe(work, self._loop)  # type: ignore[arg-type]
        self._graph.wait_until(future.done, "the page's connection")
        return future.result()

    async def _receive(self) -> None:
        async for received in self.socket:
            if received.type is WSMsgType.TEXT:
                self.answers.append(json.loads(received.data))
                continue
            (length,) = HEADER.unpack_from(received.data)
            update, offset = json.loads(received.data[4 : 4 + length]), 4 + length
            for image in update.pop("images"):
                data = received.data[offset : offset + image["bytes"]]
                self.images[image["name"]].append((image["stamp"], data))
                offset += image["bytes"]
            number = update.pop("number")
            self.state |= update.pop("state", {}) | update
            await self.socket.send_str(json.dumps({"do": "drawn", "id": 0, "update": number}))

    def ask(self, **request: Any) -> dict[str, Any]:
        """Send a request and return its last answer."""
        self.send(**request)
        self._graph.wait_until(lambda: any(a["last"] for a in self.answers), f"the answer to {request}")
        return next(a for a in self.answers if a["last"])

    def send(self, **request: Any) -> None:
        self.answers.clear()
        self._do(self.socket.send_str(json.dumps({"id": 1, **request})))

    def wait_until(self, condition: Callable[[], bool], what: str) -> None:
        self._graph.wait_until(condition, what)

    def close(self) -> None:
        self._do(self.socket.close())
        self._do(self._session.close())
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()


@pytest.fixture
def web(graph: Graph) -> WebNode:
    return graph.start(WebNode, port=0)


@pytest.fixture
def page(graph: Graph, web: WebNode) -> Any:
    one = Page(graph, web)
    yield one
    one.close()


def subscribed(node: WebNode) -> set[str]:
    return {subscription.topic_name for subscription in node.subscriptions} - {"/parameter_events"}


def test_nothing_is_received_without_a_page(graph: Graph, web: WebNode) -> None:
    assert subscribed(web) == set()
    page = Page(graph, web)
    graph.wait_until(lambda: "/gaze/state" in subscribed(web), "a subscription of gaze/state")
    assert "/vergence/overlay" not in subscribed(web)
    page.close()
    graph.wait_until(lambda: subscribed(web) == set(), "no subscription")
    graph.diagnostic("web_node: page", lambda status: "nothing is received" in status.message)
    again = Page(graph, web)
    graph.wait_until(lambda: "/gaze/state" in subscribed(web), "a subscription of gaze/state")
    again.close()


def test_a_page_that_comes_before_the_node_is_spun_is_served_too(graph: Graph) -> None:
    node = WebNode(context=graph.context, parameter_overrides=[Parameter("port", value=0)])
    page = Page(graph, node)
    graph.add(node)
    graph.wait_until(lambda: "/gaze/state" in subscribed(node), "a subscription of gaze/state")
    page.close()


def test_the_state_of_the_graph_is_shown(graph: Graph, page: Page) -> None:
    states = graph.client.create_publisher(GazeState, "gaze/state", 10)
    joints = graph.client.create_publisher(JointState, "joint_states", 10)

    def shown() -> bool:
        states.publish(GazeState(phase_name="verge", reason="because", vergence_rad=0.1))
        joints.publish(JointState(name=["pan_left", "pan_right", "tilt"], position=[-0.1, 0.1, 0.05]))
        return bool(page.state.get("gaze") and page.state.get("seen"))

    page.wait_until(shown, "the state")
    assert page.state["gaze"]["phase"] == "verge"
    assert page.state["gaze"]["reason"] == "because"
    assert page.state["seen"]["vergence_rad"] == 0.2
    assert page.state["edge"] is None
    page.wait_until(lambda: bool(page.state.get("slow")), "rates and diagnostics")
    assert {rate["topic"] for rate in page.state["slow"]["rates"]} >= {"gaze/state", "left/image"}


def test_jpegs_are_passed_through_untouched(graph: Graph, page: Page) -> None:
    header = Header(stamp=from_nanoseconds(STAMP_NS))
    messages = {eye: array_to_compressed(np.roll(PICTURE, i, axis=0), header) for i, eye in enumerate(page.images)}
    publishers = {
        eye: graph.client.create_publisher(CompressedImage, f"{eye}/image_raw/compressed", IMAGE_QOS)
        for eye in ("left", "right")
    }

    def shown() -> bool:
        for eye, publisher in publishers.items():
            publisher.publish(messages[eye])
        return bool(page.images["left"] and page.images["right"])

    page.wait_until(shown, "both images")
    for eye in publishers:
        assert page.images[eye][0] == (str(STAMP_NS), messages[eye].data.tobytes())


def test_raw_images_are_encoded_where_no_jpegs_are(graph: Graph, page: Page) -> None:
    publishers = [graph.client.create_publisher(Image, f"{eye}/image_raw", IMAGE_QOS) for eye in ("left", "right")]
    message = array_to_image(PICTURE, Header(stamp=from_nanoseconds(STAMP_NS)))

    def shown() -> bool:
        for publisher in publishers:
            publisher.publish(message)
        return bool(page.images["left"] and page.images["right"])

    page.wait_until(shown, "both images")
    assert page.images["left"][0][1][:2] == b"\xff\xd8"
    page.wait_until(lambda: bool(page.state.get("slow")), "the transports")
    assert page.state["slow"]["transports"] == {"left": "raw", "right": "raw"}


def test_an_image_that_is_none_is_refused_in_words(graph: Graph, page: Page) -> None:
    publishers = [graph.client.create_publisher(Image, f"{eye}/image_raw", IMAGE_QOS) for eye in ("left", "right")]

    def refused() -> bool:
        for publisher in publishers:
            publisher.publish(Image(encoding="nonsense", height=1, width=1, step=3, data=b"123"))
        return "encoding must be one of" in page.state.get("slow", {}).get("refused", "")

    page.wait_until(refused, "the refusal")
    assert page.images["left"] == []


def test_the_edges_are_received_while_they_are_shown(graph: Graph, web: WebNode, page: Page) -> None:
    publisher = graph.client.create_publisher(Image, "vergence/overlay", IMAGE_QOS)
    page.send(do="show", edges=True)
    graph.wait_until(lambda: publisher.get_subscription_count() > 0, "a subscription of vergence/overlay")

    def shown() -> bool:
        publisher.publish(array_to_image(PICTURE, Header(stamp=from_nanoseconds(STAMP_NS))))
        return bool(page.images["edges"])

    page.wait_until(shown, "the edges")
    page.send(do="show", edges=False)
    graph.wait_until(lambda: "/vergence/overlay" not in subscribed(web), "no subscription of vergence/overlay")


class Controller:
    """Serves gaze/look_at and the services of gaze_controller_node; every goal ends at once, as `result`."""

    def __init__(self, graph: Graph) -> None:
        self.goals: list[LookAt.Goal] = []
        self.called: list[str] = []
        self.accepts = True
        self.result = LookAt.Result(result=LookAt.Result.VERGED, time_s=1.25)
        node = graph.client
        self._server = ActionServer(
            node,
            LookAt,
            "gaze/look_at",
            self._execute,
            goal_callback=lambda goal: GoalResponse.ACCEPT if self.accepts else GoalResponse.REJECT,
            cancel_callback=lambda handle: CancelResponse.ACCEPT,
        )
        node.create_service(Trigger, "gaze_controller_node/stop", self._on_stop)
        node.create_service(SetBool, "gaze_controller_node/enable", self._on_enable)

    def _execute(self, handle: Any) -> LookAt.Result:
        self.goals.append(handle.request)
        handle.succeed()
        return self.result

    def _on_stop(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self.called.append("stop")
        response.success, response.message = True, "stopped"
        return response

    def _on_enable(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        self.called.append(f"enable {request.data}")
        response.success = True
        return response


@pytest.fixture
def controller(graph: Graph, web: WebNode, page: Page) -> Controller:
    made = Controller(graph)
    needed = ("look", "stop", "enable")
    graph.wait_until(lambda: all(page.state.get("available", {}).get(name) for name in needed), "the controller")
    return made


def test_a_click_is_a_goal_with_the_stamp_of_its_image(page: Page, controller: Controller) -> None:
    answer = page.ask(do="pixel", eye="right", x=12.5, y=7, stamp=str(STAMP_NS))
    assert (answer["ok"], answer["result"], answer["text"]) == (True, "VERGED", "VERGED after 1.25 s")
    (goal,) = controller.goals
    assert (goal.kind, goal.eye) == (LookAt.Goal.PIXEL, LookAt.Goal.EYE_RIGHT)
    assert (goal.right_x_px, goal.right_y_px) == (12.5, 7.0)
    assert to_nanoseconds(goal.header.stamp) == STAMP_NS
    assert (goal.width_px, goal.height_px) == (0.0, 0.0)
    assert page.answers[0] == {"answer": 1, "ok": True, "text": "the goal is accepted", "last": False}


def test_a_box_states_its_size(page: Page, controller: Controller) -> None:
    page.ask(do="pixel", eye="left", x=12, y=7, stamp="0", width=30, height=20)
    (goal,) = controller.goals
    assert (goal.left_x_px, goal.width_px, goal.height_px) == (12.0, 30.0, 20.0)


def test_a_goal_that_fails_says_why(page: Page, controller: Controller) -> None:
    controller.result = LookAt.Result(result=LookAt.Result.LOST, reason="gone", time_s=5.0)
    answer = page.ask(do="class", name="cube")
    assert (answer["ok"], answer["text"]) == (False, "LOST after 5.00 s: gone")
    assert controller.goals[0].class_name == "cube"


def test_a_goal_that_is_rejected_says_why_and_nothing_stays_subscribed(
    graph: Graph, web: WebNode, page: Page, controller: Controller
) -> None:
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    graph.client.create_publisher(GazeGoal, "gaze/goal", latched).publish(
        GazeGoal(state=GazeGoal.REJECTED, result=LookAt.Result.INVALID, reason="disabled")
    )
    controller.accepts = False
    answer = page.ask(do="class", name="cube")
    assert (answer["ok"], answer["text"]) == (False, "INVALID: disabled")
    graph.wait_until(lambda: "/gaze/goal" not in subscribed(web), "no subscription of gaze/goal")


@pytest.mark.parametrize(
    ("command", "called"), [("stop", "stop"), ("enable", "enable True"), ("disable", "enable False")]
)
def test_buttons_call_the_services(page: Page, controller: Controller, command: str, called: str) -> None:
    assert page.ask(do=command)["ok"]
    assert controller.called == [called]


def test_hold_and_centre_are_goals_of_angles(page: Page, controller: Controller) -> None:
    page.ask(do="hold")
    page.ask(do="centre")
    hold, centre = controller.goals
    assert (hold.kind, hold.version_rad, hold.vergence_rad, hold.tilt_rad) == (LookAt.Goal.RELATIVE_ANGLES, 0, 0, 0)
    assert (centre.kind, centre.version_rad, centre.vergence_rad, centre.tilt_rad) == (LookAt.Goal.ANGLES, 0, 0, 0)


def test_what_is_not_served_is_said(page: Page) -> None:
    assert page.ask(do="park")["text"] == "nothing serves /servo_node/park: servo_node does"
    assert page.ask(do="hold")["text"] == "nothing serves /gaze/look_at: gaze_controller_node does"
    assert page.ask(do="cancel")["text"] == "there is no goal of a page to cancel"


def test_parameters_are_read_and_set(graph: Graph, web: WebNode, page: Page) -> None:
    assert "/web_node" in page.ask(do="nodes")["nodes"]
    entries = {entry["name"]: entry for entry in page.ask(do="parameters", node="/web_node")["parameters"]}
    rate = entries["image_rate_hz"]
    assert (rate["value"], rate["low"], rate["high"], rate["kind"], rate["read_only"]) == (15.0, 1, 60, "float", False)
    assert "largest rate" in rate["description"]
    assert entries["port"]["read_only"]
    # JSON has no type of its own for a whole number of a parameter that is a float.
    assert page.ask(do="set", node="/web_node", name="image_rate_hz", value=7)["value"] == 7.0
    assert web.get_parameter("image_rate_hz").value == 7.0


@pytest.mark.parametrize(
    ("node", "name", "value", "words"),
    [
        ("/web_node", "image_rate_hz", 1000, "image_rate_hz' must be a number from 1 to 60"),
        ("/web_node", "image_rate_hz", "fast", "image_rate_hz must be a number"),
        ("/web_node", "image_rate_hz", [1.0], "image_rate_hz must be one value"),
        ("/web_node", "port", 1, "port"),
        ("/web_node", "no_such", 1, "no_such"),
        ("/no_such_node", "rate", 1, "node must be one that runs here"),
    ],
)
def test_a_wrong_parameter_is_refused_in_words(page: Page, node: str, name: str, value: Any, words: str) -> None:
    answer = page.ask(do="set", node=node, name=name, value=value)
    assert not answer["ok"]
    assert words in answer["text"]


def test_two_pages_at_once(graph: Graph, web: WebNode, page: Page) -> None:
    other = Page(graph, web)
    states = graph.client.create_publisher(GazeState, "gaze/state", 10)

    def shown() -> bool:
        states.publish(GazeState(phase_name="idle"))
        return bool(page.state.get("gaze") and other.state.get("gaze"))

    graph.wait_until(shown, "the state in both pages")
    other.close()
    page.state.clear()

    def still_shown() -> bool:
        states.publish(GazeState(phase_name="idle"))
        return bool(page.state.get("gaze"))

    graph.wait_until(still_shown, "the state in the page that is left")
