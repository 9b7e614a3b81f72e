"""The parameters of the running nodes, by the services that every node has."""

from functools import partial
from time import monotonic
from typing import Any

from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters, SetParameters
from rclpy.node import Node

from vergence_web.requests import Answer, ListNodes, Message, ReadParameters, SetParameter
from vergence_web.ros.answering import Reply, answering
from vergence_web.ros.parameter_values import entry, plain, typed
from vergence_web.ros.service_calls import Call, ServiceCalls

_ANSWERED_WITHIN_S = 5.0
_LIST = "/list_parameters"
_LONGEST_REASON = 1000


class NodeParameters:
    """Reads and sets parameters of the nodes of this node's namespace; everything runs in the executor's thread."""

    def __init__(self, node: Node) -> None:
        self._node, self._services = node, ServiceCalls(node)
        self._waiting: dict[int, tuple[float, _Exchange]] = {}
        self._count = 0

    def perform(self, message: Message, reply: Reply) -> None:
        """Do what a page asks for: ListNodes, ReadParameters or SetParameter."""
        request = message.request
        if isinstance(request, ListNodes):
            nodes = self._nodes()
            reply(Answer(message.number, True, f"{len(nodes)} nodes", {"nodes": nodes}))
        elif isinstance(request, (ReadParameters, SetParameter)):
            if request.node not in self._nodes():
                reply(Answer(message.number, False, f"node must be one that runs here: got {request.node!r}"))
                return
            self._count += 1
            exchange = _Exchange(self._node, self._services, message, partial(self._end, self._count, reply))
            self._waiting[self._count] = (monotonic() + _ANSWERED_WITHIN_S, exchange)
            exchange.read(request) if isinstance(request, ReadParameters) else exchange.set(request)

    def check(self) -> None:
        """Answer what has waited for too long: the node has gone, or hangs."""
        now_s = monotonic()
        for until_s, exchange in list(self._waiting.values()):
            if now_s > until_s:
                exchange.give_up(f"the node does not answer within {_ANSWERED_WITHIN_S:g} s")

    def forget(self) -> None:
        """Leave the services: no page is open."""
        self._services.forget()
        self._waiting.clear()

    def _end(self, key: int, reply: Reply, answer: Answer) -> None:
        if self._waiting.pop(key, None) is not None:
            reply(answer)

    def _nodes(self) -> list[str]:
        """Return the full names of the nodes with parameters in this namespace, this one's too."""
        own = self._node.get_namespace().rstrip("/") + "/"
        names = [name for name, _ in self._node.get_service_names_and_types()]
        return sorted(name.removesuffix(_LIST) for name in names if name.endswith(_LIST) and name.startswith(own))


class _Exchange:
    """One request: its calls one after another, and its one answer by `end`."""

    def __init__(self, node: Node, services: ServiceCalls, message: Message, end: Reply) -> None:
        self._node, self._services, self._message, self._end = node, services, message, end
        self._newest: Call | None = None

    def give_up(self, text: str) -> None:
        """Answer that it failed, and wait for no answer."""
        if self._newest is not None:
            self._services.abandon(self._newest)
        self._answer(False, text)

    def _call(self, of: str, service: str, kind: Any, request: Any, then: Any) -> None:
        guarded = answering(self._node, self._message, self._end, then)
        self._newest = self._services.call(f"{of}/{service}", kind, request, guarded)

    def _answer(self, ok: bool, text: str, **values: Any) -> None:
        self._end(Answer(self._message.number, ok, text, values))

    def read(self, request: ReadParameters) -> None:
        """Answer with every parameter of a node."""

        def listed(result: Any) -> None:
            names = [name for name in sorted(result.result.names) if not name.startswith("qos_overrides.")]
            self._call(
                request.node,
                "describe_parameters",
                DescribeParameters,
                DescribeParameters.Request(names=names),
                lambda described: self._read_values(request.node, names, described.descriptors),
            )

        self._call(request.node, "list_parameters", ListParameters, ListParameters.Request(), listed)

    def _read_values(self, of: str, names: list[str], descriptors: list[Any]) -> None:
        def got(result: Any) -> None:
            entries = [entry(one, value) for one, value in zip(descriptors, result.values, strict=False)]
            self._answer(True, f"{len(entries)} parameters", node=of, parameters=entries)

        self._call(of, "get_parameters", GetParameters, GetParameters.Request(names=names), got)

    def set(self, request: SetParameter) -> None:
        """Set a parameter, and answer with its value afterwards."""

        def described(result: Any) -> None:
            if not result.descriptors or not result.descriptors[0].name:
                self._answer(False, f"{request.node} must have the parameter that is set: got {request.name!r}")
                return
            try:
                change = typed(request, result.descriptors[0].type)
            except ValueError as error:
                self._answer(False, str(error))
                return
            self._call(
                request.node,
                "set_parameters",
                SetParameters,
                SetParameters.Request(parameters=[change]),
                lambda changed: self._on_set(request, changed.results[0]),
            )

        describe = DescribeParameters.Request(names=[request.name])
        self._call(request.node, "describe_parameters", DescribeParameters, describe, described)

    def _on_set(self, request: SetParameter, outcome: Any) -> None:
        if not outcome.successful:
            self._answer(False, outcome.reason[:_LONGEST_REASON])
            return

        def got(result: Any) -> None:
            value = plain(result.values[0])
            text = f"{request.name} of {request.node} is {value}"
            self._answer(True, text, node=request.node, name=request.name, value=value)

        self._call(request.node, "get_parameters", GetParameters, GetParameters.Request(names=[request.name]), got)
