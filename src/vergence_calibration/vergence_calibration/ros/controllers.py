"""Other nodes that command a running head: controllers are disabled through their own service, and restored after."""

import threading
import time
from dataclasses import dataclass
from typing import Any

from rcl_interfaces.srv import GetParameters
from rclpy.node import Node
from std_srvs.srv import SetBool, Trigger

from vergence_calibration.identification.axis_log import IdentifyError
from vergence_msgs.msg import GazeState

_SERVICE_TIMEOUT_S = 10.0
_DISCOVERY_S = 3.0


@dataclass(frozen=True)
class PausedController:
    """A controller that was disabled, and its state before."""

    name: str
    was_idle: bool
    was_disabled: bool


class Controllers:
    """The nodes that publish on a topic and have the services `~/enable` and `~/stop`, as gaze_controller_node has."""

    def __init__(self, node: Node, topic: str) -> None:
        self._node, self._topic = node, node.resolve_topic_name(topic)
        self._state: GazeState | None = None
        self.paused: list[PausedController] = []
        node.create_subscription(GazeState, "gaze/state", self._on_state, 10)

    def others(self) -> list[str]:
        """Return the full names of the other nodes that may publish commands."""
        infos = self._node.get_publishers_info_by_topic(self._topic)
        names = {f"{info.node_namespace.rstrip('/')}/{info.node_name}" for info in infos}
        return sorted(names - {self._node.get_fully_qualified_name()})

    def pause(self) -> None:
        """Disable every controller that can be, and record it in `paused`. Raises IdentifyError if one refuses."""
        for name in self._that_can_be():
            state = self._state
            idle = state is not None and state.phase == GazeState.PHASE_IDLE
            disabled = idle and state is not None and state.reason.startswith("disabled")
            self.paused.append(
                PausedController(name, idle, disabled)
            )  # recorded first: an interrupt must not leave it disabled
            answer = call(self._node, SetBool, f"{name}/enable", SetBool.Request(data=False))
            if answer is None or not answer.success:
                raise IdentifyError(f"{name} commands the joints and could not be disabled: stop it first")

    def _that_can_be(self) -> list[str]:
        """Return the other commanders that can be disabled; services may be discovered after topics."""
        deadline_s = time.monotonic() + _DISCOVERY_S
        while True:
            services = {name for name, _ in self._node.get_service_names_and_types()}
            able = [name for name in self.others() if f"{name}/enable" in services]
            if len(able) == len(self.others()) or time.monotonic() > deadline_s:
                return able
            time.sleep(0.1)

    def resume(self) -> list[str]:
        """Restore the paused controllers' states; return the names of those that do not answer."""
        unresponsive = []
        for controller in self.paused:
            if controller.was_disabled:
                continue
            answer = call(self._node, SetBool, f"{controller.name}/enable", SetBool.Request(data=True))
            if answer is not None and controller.was_idle:
                # an enabled controller would start to verge: one that was idle stays idle
                answer = call(self._node, Trigger, f"{controller.name}/stop", Trigger.Request())
            if answer is None:
                unresponsive.append(controller.name)
        return unresponsive

    def _on_state(self, message: GazeState) -> None:
        self._state = message


def number_of(node: Node, owner: str, parameter: str) -> float | None:
    """Return a number parameter of another node; None if it has none, or does not answer."""
    answer = call(node, GetParameters, f"{owner}/get_parameters", GetParameters.Request(names=[parameter]))
    if answer is None or len(answer.values) != 1 or answer.values[0].type != 3:
        return None
    return float(answer.values[0].double_value)


def call(node: Node, kind: Any, name: str, request: Any) -> Any:
    """Call a service while another thread spins `node`; None without an answer."""
    client = node.create_client(kind, name)
    try:
        if not client.wait_for_service(_SERVICE_TIMEOUT_S):
            return None
        done = threading.Event()
        future = client.call_async(request)
        future.add_done_callback(lambda _: done.set())
        return future.result() if done.wait(_SERVICE_TIMEOUT_S) else None
    finally:
        node.destroy_client(client)
