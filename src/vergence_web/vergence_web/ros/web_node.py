"""web_node: the page of the running head, for browsers; it receives nothing while no page is open."""

import json
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from vergence_common.diagnostics import OK, Diagnostics, Report
from vergence_common.node_main import run_node
from vergence_common.parameters import ParameterSet, declare
from vergence_common.qos import watch_qos
from vergence_rig.rig_file import load_rig
from vergence_web.access import Access, is_loopback, page_urls, read_token
from vergence_web.network import own_addresses
from vergence_web.parameters import GROUPS, WebNodeParameters
from vergence_web.requests import ListNodes, Message, ReadParameters, SetParameter
from vergence_web.ros.answering import Reply, answering
from vergence_web.ros.graph_input import GraphInput
from vergence_web.ros.head_commands import HeadCommands
from vergence_web.ros.node_parameters import NodeParameters
from vergence_web.server import Limits, PageServer
from vergence_web.server_thread import ServerThread
from vergence_web.update import Part
from vergence_web.viewers import Viewers

_CHECK_S, _BEGIN_S = 1.0, 0.02


class WebNode(Node):
    """The page's server in a thread of its own, beside the executor's: callables pass between them."""

    def __init__(self, **options: Any) -> None:
        super().__init__("web_node", **options)
        self._settings = declare(self, GROUPS)
        values = self._values()
        rig = load_rig(values.rig)
        token = read_token(values.token_file, values.address)
        self._diagnostics = Diagnostics(self)
        qos = watch_qos(self, self._diagnostics)
        self._calls: deque[Callable[[], None]] = deque()
        self._viewers = Viewers(self._on_viewers)
        self._input = GraphInput(self, rig, self._values, qos, self._post, lambda: self._viewers.ready)
        self._commands = HeadCommands(self, rig)
        self._node_parameters = NodeParameters(self)
        self._limits = Limits(values.max_viewers, values.requests_per_s)
        self._check_timer: Any = None
        self._page = PageServer(Access(token, values.address), self._viewers, self._limits, self._on_request)
        self._thread = ServerThread(self._page.app, values.address, values.port)
        self._settings.on_change(self._on_settings)
        self._diagnostics.add("page", self._report)
        # A page may come before this node is spun.
        self._begin = self.create_timer(_BEGIN_S, self._on_spun, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self.urls = page_urls(values.address, self._thread.port, token, own_addresses())
        """Where the page can be opened, with its token."""
        for url in self.urls:
            self.get_logger().info(f"the page: {url}")
        if not is_loopback(values.address):
            self.get_logger().info("who has this address and token can move the head: pass on neither")

    def close(self) -> None:
        """Close every page and the server."""
        self._thread.close()

    def _values(self) -> WebNodeParameters:
        return self._settings.get(WebNodeParameters)

    def _on_settings(self, settings: ParameterSet) -> None:
        values = settings.get(WebNodeParameters)
        self._limits.max_viewers, self._limits.requests_per_s = values.max_viewers, values.requests_per_s
        if self._input.running:  # the rate of states is its timer's
            self._input.stop()
            self._input.start()

    def _post(self, parts: Mapping[str, Part]) -> None:
        self._thread.run_soon(lambda: self._viewers.post(parts))

    def _run_soon(self, call: Callable[[], None]) -> None:
        """Have the executor's thread run this."""
        self._calls.append(call)
        if self.executor is not None:  # rclpy's events executor has tasks, but no guard conditions
            self.executor.create_task(self._run_calls)

    def _on_spun(self) -> None:
        self.destroy_timer(self._begin)
        self._run_calls()

    def _run_calls(self) -> None:
        while self._calls:
            self._calls.popleft()()

    def _on_viewers(self, count: int, edges: bool) -> None:
        """Receive the graph while a page is open; called in the server's thread."""
        self._run_soon(lambda: self._update_input(count, edges))

    def _update_input(self, count: int, edges: bool) -> None:
        if count and self._check_timer is None:
            self._input.start()
            self._check_timer = self.create_timer(_CHECK_S, self._check, clock=Clock(clock_type=ClockType.STEADY_TIME))
        if not count and self._check_timer is not None:
            self._input.stop()
            self.destroy_timer(self._check_timer)
            self._check_timer = None
            self._node_parameters.forget()
        self._input.show_edges(edges)
        if count:
            self._check()

    def _check(self) -> None:
        self._commands.check()
        self._node_parameters.check()
        self._post({"available": Part(json.dumps(self._commands.available()))})

    def _on_request(self, message: Message, reply: Reply) -> None:
        """Perform what a page asks for; called in the server's thread."""
        of_parameters = isinstance(message.request, (ListNodes, ReadParameters, SetParameter))
        part = self._node_parameters if of_parameters else self._commands
        self._run_soon(lambda: answering(self, message, reply, part.perform)(message, reply))

    def _report(self) -> Report:
        count = len(self._viewers)
        values: dict[str, object] = {"pages": count, "requests_refused": self._page.refused}
        latency_s = self._viewers.latency_s()
        if latency_s == latency_s:
            values["stamp_to_screen_median_ms"] = round(1e3 * latency_s, 1)
        what = f"{count} page{'s' * (count != 1)} open" if count else "no page is open: nothing is received"
        return Report(OK, what, values)


def main(args: Sequence[str] | None = None) -> int:
    """Run the node; see `vergence_common.node_main`."""
    return run_node(WebNode, args, GROUPS)
