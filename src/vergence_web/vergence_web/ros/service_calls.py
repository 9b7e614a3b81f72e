"""Calls of services of other nodes that are sent again until they are answered: each may be made twice.

A client sees a service before the service sees the client, and what is answered meanwhile is lost.
"""

from collections.abc import Callable
from dataclasses import dataclass
from time import monotonic
from typing import Any

from rclpy.client import Client
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

_LOOK_S, _AGAIN_S = 0.02, 1.0
_MOST = 100
"""Calls that wait at a time; the oldest is abandoned for one more."""


@dataclass(eq=False)
class Call:
    """One call: its answer is passed to `then`, once; `future` is of the last time that it was sent."""

    client: Client
    request: Any
    then: Callable[[Any], None]
    future: Any = None
    sent_s: float = 0.0


class ServiceCalls:
    """Keeps one client for each service until `forget`; everything runs in the executor's thread."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._clients: dict[str, Client] = {}
        self._calls: list[Call] = []
        self._timer: Any = None

    def client(self, service: str, kind: Any) -> Client:
        """Return the client of a service."""
        if service not in self._clients:
            self._clients[service] = self._node.create_client(kind, service)
        return self._clients[service]

    def call(self, service: str, kind: Any, request: Any, then: Callable[[Any], None]) -> Call:
        """Call a service, and then `then` with its answer; it is sent until it is answered or abandoned."""
        if len(self._calls) >= _MOST:
            self.abandon(self._calls[0])
        call = Call(self.client(service, kind), request, then)
        self._calls.append(call)
        self._send_due()
        return call

    def abandon(self, call: Call) -> None:
        """Wait no longer for an answer."""
        if call in self._calls:
            self._calls.remove(call)
        if call.future is not None:
            call.client.remove_pending_request(call.future)

    def forget(self) -> None:
        """Leave every service, and wait for no answer."""
        for call in list(self._calls):
            self.abandon(call)
        self._send_due()
        for client in self._clients.values():
            self._node.destroy_client(client)
        self._clients.clear()

    def _send_due(self) -> None:
        """Send what its service is there for, and again what has not been answered."""
        now_s = monotonic()
        for call in list(self._calls):
            due = call.future is None or now_s - call.sent_s > _AGAIN_S
            if due and call.client.service_is_ready():
                self._send(call, now_s)
        if self._calls and self._timer is None:
            steady = Clock(clock_type=ClockType.STEADY_TIME)
            self._timer = self._node.create_timer(_LOOK_S, self._send_due, clock=steady)
        elif not self._calls and self._timer is not None:
            self._node.destroy_timer(self._timer)
            self._timer = None

    def _send(self, call: Call, now_s: float) -> None:
        if call.future is not None:
            call.client.remove_pending_request(call.future)
        call.future, call.sent_s = call.client.call_async(call.request), now_s

        def answered(future: Any) -> None:
            if call in self._calls and not future.cancelled():
                self._calls.remove(call)
                call.then(future.result())

        call.future.add_done_callback(answered)
