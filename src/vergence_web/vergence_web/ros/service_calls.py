"""Calls of services of other nodes, by clients that are made when they are needed first."""

from collections.abc import Callable
from typing import Any

from rclpy.client import Client
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

_LOOK_S = 0.02


class ServiceCalls:
    """Keeps one client for each service until `forget`; everything runs in the executor's thread."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._clients: dict[str, Client] = {}
        self._unready: list[tuple[Client, Any, Callable[[Any], None]]] = []
        self._timer: Any = None

    def call(self, service: str, kind: Any, request: Any, then: Callable[[Any], None]) -> None:
        """Call a service by its full name, and then `then` with its answer; never, where nothing answers."""
        if service not in self._clients:
            self._clients[service] = self._node.create_client(kind, service)
        self._unready.append((self._clients[service], request, then))
        self._send_ready()

    def forget(self) -> None:
        """Leave every service; what has not been answered never will be."""
        self._unready.clear()
        self._send_ready()
        for client in self._clients.values():
            self._node.destroy_client(client)
        self._clients.clear()

    def give_up(self) -> None:
        """Send nothing more to services that are not there yet."""
        self._unready.clear()

    def _send_ready(self) -> None:
        """Send what its service is there for: the discovery of a new client takes a moment."""
        waiting, self._unready = self._unready, []
        for client, request, then in waiting:
            if client.service_is_ready():
                client.call_async(request).add_done_callback(_with_result(then))
            else:
                self._unready.append((client, request, then))
        if self._unready and self._timer is None:
            steady = Clock(clock_type=ClockType.STEADY_TIME)
            self._timer = self._node.create_timer(_LOOK_S, self._send_ready, clock=steady)
        elif not self._unready and self._timer is not None:
            self._node.destroy_timer(self._timer)
            self._timer = None


def _with_result(then: Callable[[Any], None]) -> Callable[[Any], None]:
    return lambda future: then(future.result())
