"""The parameters of the running nodes, by the services that every node has."""

from collections.abc import Callable
from functools import partial
from time import monotonic
from typing import Any

from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import ParameterDescriptor, ParameterType
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters, SetParameters
from rclpy.client import Client
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python

from vergence_web.page_state import figure
from vergence_web.requests import Answer, ListNodes, Message, ReadParameters, SetParameter

Reply = Callable[[Answer], None]

_ANSWERED_WITHIN_S, _LOOK_S = 5.0, 0.02
_LISTS = "/list_parameters"
_SCALARS = {
    ParameterType.PARAMETER_BOOL: bool,
    ParameterType.PARAMETER_INTEGER: int,
    ParameterType.PARAMETER_DOUBLE: float,
    ParameterType.PARAMETER_STRING: str,
}
_ARRAYS = {
    ParameterType.PARAMETER_BOOL_ARRAY: bool,
    ParameterType.PARAMETER_INTEGER_ARRAY: int,
    ParameterType.PARAMETER_DOUBLE_ARRAY: float,
    ParameterType.PARAMETER_STRING_ARRAY: str,
}


class NodeParameters:
    """Reads and sets parameters of the nodes of this node's namespace; everything runs in the executor's thread."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._clients: dict[tuple[str, str], Client] = {}
        self._waiting: dict[int, tuple[float, Message, Reply]] = {}
        self._unready: list[tuple[Client, Any, Callable[[Any], None]]] = []
        self._timer: Any = None

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
            self._wait(message, reply)
            if isinstance(request, SetParameter):
                self._set(request, message, reply)
            else:
                self._read(request.node, message, reply)

    def check(self) -> None:
        """Answer what has waited for too long: the node has gone, or hangs."""
        now_s = monotonic()
        for key, (until_s, message, reply) in list(self._waiting.items()):
            if now_s > until_s:
                del self._waiting[key]
                self._unready.clear()
                reply(Answer(message.number, False, f"the node does not answer within {_ANSWERED_WITHIN_S:g} s"))

    def forget(self) -> None:
        """Leave the services: no page is open."""
        for client in self._clients.values():
            self._node.destroy_client(client)
        self._clients.clear()
        self._waiting.clear()
        self._unready.clear()
        self._send_ready()

    def _nodes(self) -> list[str]:
        """Return the full names of the nodes with parameters in this namespace, this one's too."""
        own = self._node.get_namespace().rstrip("/") + "/"
        lists = [name for name, _ in self._node.get_service_names_and_types() if name.endswith(_LISTS)]
        return sorted(name.removesuffix(_LISTS) for name in lists if name.startswith(own))

    def _wait(self, message: Message, reply: Reply) -> None:
        self._waiting[id(message)] = (monotonic() + _ANSWERED_WITHIN_S, message, reply)

    def _end(self, message: Message, reply: Reply, answer: Answer) -> None:
        if self._waiting.pop(id(message), None) is not None:
            reply(answer)

    def _call(self, node: str, service: str, kind: Any, request: Any, then: Callable[[Any], None]) -> None:
        key = (node, service)
        if key not in self._clients:
            self._clients[key] = self._node.create_client(kind, f"{node}/{service}")
        self._unready.append((self._clients[key], request, then))
        self._send_ready()

    def _send_ready(self) -> None:
        """Send what its service is there for: the discovery of a new client takes a moment."""
        waiting, self._unready = self._unready, []
        for client, request, then in waiting:
            if client.service_is_ready():
                client.call_async(request).add_done_callback(partial(_pass_on, then))
            else:
                self._unready.append((client, request, then))
        if self._unready and self._timer is None:
            self._timer = self._node.create_timer(
                _LOOK_S, self._send_ready, clock=Clock(clock_type=ClockType.STEADY_TIME)
            )
        elif not self._unready and self._timer is not None:
            self._node.destroy_timer(self._timer)
            self._timer = None

    def _read(self, node: str, message: Message, reply: Reply) -> None:
        def listed(result: Any) -> None:
            names = [name for name in sorted(result.result.names) if not name.startswith("qos_overrides.")]
            describe = DescribeParameters.Request(names=names)
            self._call(node, "describe_parameters", DescribeParameters, describe, lambda r: described(names, r))

        def described(names: list[str], result: Any) -> None:
            get = GetParameters.Request(names=names)
            self._call(node, "get_parameters", GetParameters, get, lambda r: got(result.descriptors, r.values))

        def got(descriptors: list[ParameterDescriptor], values: list[Any]) -> None:
            entries = [_entry(one, value) for one, value in zip(descriptors, values, strict=False)]
            answer = Answer(message.number, True, f"{len(entries)} parameters", {"node": node, "parameters": entries})
            self._end(message, reply, answer)

        self._call(node, "list_parameters", ListParameters, ListParameters.Request(), listed)

    def _set(self, request: SetParameter, message: Message, reply: Reply) -> None:
        def described(result: Any) -> None:
            (descriptor,) = result.descriptors
            try:
                value = _typed(request, descriptor)
            except ValueError as error:
                self._end(message, reply, Answer(message.number, False, str(error)))
                return
            change = SetParameters.Request(parameters=[value])
            self._call(request.node, "set_parameters", SetParameters, change, changed)

        def changed(result: Any) -> None:
            (outcome,) = result.results
            if not outcome.successful:
                self._end(message, reply, Answer(message.number, False, outcome.reason[:1000]))
                return
            get = GetParameters.Request(names=[request.name])
            self._call(request.node, "get_parameters", GetParameters, get, read_back)

        def read_back(result: Any) -> None:
            value = _plain(parameter_value_to_python(result.values[0]))
            text = f"{request.name} of {request.node} is {value}"
            values = {"node": request.node, "name": request.name, "value": value}
            self._end(message, reply, Answer(message.number, True, text, values))

        describe = DescribeParameters.Request(names=[request.name])
        self._call(request.node, "describe_parameters", DescribeParameters, describe, described)


def _pass_on(then: Callable[[Any], None], future: Any) -> None:
    then(future.result())


def _entry(descriptor: ParameterDescriptor, value: Any) -> dict[str, Any]:
    ranges = [*descriptor.floating_point_range, *descriptor.integer_range]
    kind = value.type if descriptor.type == ParameterType.PARAMETER_NOT_SET else descriptor.type
    return {
        "name": descriptor.name,
        "description": descriptor.description,
        "allowed": descriptor.additional_constraints,
        "read_only": bool(descriptor.read_only),
        "kind": _kind_name(kind),
        "low": figure(ranges[0].from_value) if ranges else None,
        "high": figure(ranges[0].to_value) if ranges else None,
        "value": _plain(parameter_value_to_python(value)),
    }


def _kind_name(kind: int) -> str:
    if kind in _SCALARS:
        return {bool: "bool", int: "int", float: "float", str: "str"}[_SCALARS[kind]]
    return "list"


def _plain(value: Any) -> Any:
    """Return a parameter's value for JSON."""
    if isinstance(value, float):
        return value if figure(value) is not None else str(value)
    if value is None or isinstance(value, (bool, int, str)):
        return value
    return [_plain(element) for element in value]


def _typed(request: SetParameter, descriptor: ParameterDescriptor) -> ParameterMessage:
    """Return the parameter in its declared type: JSON does not tell 1 from 1.0. Raises ValueError."""
    value, kind = request.value, descriptor.type
    if not descriptor.name:
        raise ValueError(f"{request.node} has no parameter {request.name!r}")
    if kind in _ARRAYS and isinstance(value, tuple):
        elements = [_cast(request.name, element, _ARRAYS[kind]) for element in value]
        return Parameter(request.name, Parameter.Type(kind), elements).to_parameter_msg()
    if kind in _SCALARS and not isinstance(value, tuple):
        return Parameter(
            request.name, Parameter.Type(kind), _cast(request.name, value, _SCALARS[kind])
        ).to_parameter_msg()
    if kind == ParameterType.PARAMETER_NOT_SET:  # a list without elements has no type of its own
        return Parameter(request.name, value=list(value) if isinstance(value, tuple) else value).to_parameter_msg()
    raise ValueError(f"{request.name} must be {'a list' if kind in _ARRAYS else 'one value'}: got {value!r}")


def _cast(name: str, value: Any, kind: type) -> Any:
    if kind is float and type(value) in (int, float):
        return float(value)
    if kind is int and isinstance(value, float) and value.is_integer():
        return int(value)
    if type(value) is not kind:
        words = {bool: "true or false", int: "a whole number", float: "a number", str: "a text"}[kind]
        raise ValueError(f"{name} must be {words}: got {value!r}")
    return value
