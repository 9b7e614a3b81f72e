"""SROS2 policies of the nodes: what each publishes, subscribes, serves and asks for, as the running nodes say."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from xml.sax.saxutils import quoteattr

from rclpy.node import Node

from vergence_bringup.node_table import NODES

EYES = ("left", "right")
OPERATOR = "operator"
"""Enclave of the tools: `vergence look`, `watch`, `identify`, `ros2` and recordings."""

OPERATOR_TOPICS = ("/joint_command", "/gaze/attention", "/gaze/target", "/rosout")
"""What the operator's tools may publish beside the parameters' events."""

_COMPRESSED = tuple(f"/{eye}/image_raw/compressed" for eye in EYES)
_DETECTIONS = tuple(f"/vergence/{eye}_detections" for eye in EYES)
_SHOWN = (
    *(
        "/gaze/state",
        "/gaze/goal",
        "/joint_states",
        "/joint_command",
        "/vergence/edge",
        "/vergence/error",
        "/vergence/track",
    ),
    *("/vergence/box", "/vergence/detections", "/vergence/detector_classes", "/vergence/overlay", "/diagnostics"),
    *(f"/{eye}/{topic}" for eye in EYES for topic in ("camera_info", "image_raw", "image_raw/compressed")),
)
SOMETIMES: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "box_metric_node": (_DETECTIONS, _COMPRESSED),
    "edge_metric_node": ((), _COMPRESSED),
    "eye_rotation_node": ((), _COMPRESSED),
    "gaze_controller_node": ((), ("/vergence/edge", "/tf", "/tf_static")),
    "web_node": ((), _SHOWN),
}
"""Topics that a node publishes and subscribes only with some parameters or installed packages, or while it is used."""
OPTIONAL_ACTIONS = {
    "gaze_controller_node": ("/gaze/point_head",),
    "servo_node": ("/servo_node/follow_joint_trajectory",),
}
"""Actions that a node serves only where their messages are installed."""
_PARAMETER_SERVICES = ("list_parameters", "describe_parameters", "get_parameters", "set_parameters")
CLOCK = "/clock"
"""Subscribed by every node that uses simulated time."""

_ACTION = "/_action/"
_ACTION_TOPICS = ("feedback", "status")


@dataclass(frozen=True)
class Endpoints:
    """Full names of what one node has; actions stand for their topics and services."""

    publish: frozenset[str]
    subscribe: frozenset[str]
    reply: frozenset[str]
    request: frozenset[str]
    execute: frozenset[str]
    call: frozenset[str] = frozenset()


def endpoints_of(node: Node) -> Endpoints:
    """Return what a running node has, as the graph says."""
    name, namespace = node.get_name(), node.get_namespace()

    def names(found: Iterable[tuple[str, Sequence[str]]]) -> set[str]:
        return {one for one, _ in found}

    publish = names(node.get_publisher_names_and_types_by_node(name, namespace))
    subscribe = names(node.get_subscriber_names_and_types_by_node(name, namespace))
    reply = names(node.get_service_names_and_types_by_node(name, namespace))
    request = names(node.get_client_names_and_types_by_node(name, namespace))
    actions, called = (
        frozenset(service.partition(_ACTION)[0] for service in services if _ACTION in service)
        for services in (reply, request)
    )
    return Endpoints(
        frozenset(topic for topic in publish if _ACTION not in topic),
        frozenset(topic for topic in subscribe if _ACTION not in topic),
        frozenset(service for service in reply if _ACTION not in service),
        frozenset(service for service in request if _ACTION not in service),
        actions,
        called,
    )


def with_sometimes(executable: str, endpoints: Endpoints) -> Endpoints:
    """Return what a node is allowed: what it has, and what it has sometimes."""
    publish, subscribe = SOMETIMES.get(executable, ((), ()))
    return replace(
        endpoints,
        publish=endpoints.publish.union(publish),
        subscribe=endpoints.subscribe.union(subscribe, (CLOCK,)),
        request=endpoints.request.union(_parameter_services() if executable == "web_node" else ()),
        execute=endpoints.execute.union(OPTIONAL_ACTIONS.get(executable, ())),
    )


def _parameter_services() -> list[str]:
    """Return the services by which a page reads and sets the parameters of every node."""
    cameras = [f"/{eye}/camera_node" for eye in EYES]
    nodes = [*(f"/{name}" for name in NODES if name != "camera_node"), *cameras]
    return [f"{node}/{service}" for node in nodes for service in _PARAMETER_SERVICES]


def policy(enclaves: Mapping[str, Sequence[tuple[str, str, Endpoints]]]) -> str:
    """Return the policy file of enclaves, each with the namespace, name and endpoints of its nodes."""
    lines = ['<?xml version="1.0" encoding="UTF-8"?>', '<policy version="0.2.0">', "  <enclaves>"]
    for enclave, nodes in enclaves.items():
        lines += [f"    <enclave path={quoteattr(f'/vergence/{enclave}')}>", "      <profiles>"]
        for namespace, name, endpoints in nodes:
            lines += _profile(namespace, name, endpoints)
        lines += ["      </profiles>", "    </enclave>"]
    lines += [*_operator(), "  </enclaves>", "</policy>", ""]
    return "\n".join(lines)


def _profile(namespace: str, name: str, endpoints: Endpoints) -> list[str]:
    lines = [f"        <profile ns={quoteattr(namespace)} node={quoteattr(name)}>"]
    for group, element, verb, names in (
        ("topics", "topic", "publish", endpoints.publish),
        ("topics", "topic", "subscribe", endpoints.subscribe),
        ("services", "service", "reply", endpoints.reply),
        ("services", "service", "request", endpoints.request),
        ("actions", "action", "execute", endpoints.execute),
        ("actions", "action", "call", endpoints.call),
    ):
        if names:
            lines.append(f'          <{group} {verb}="ALLOW">')
            lines += [f"            <{element}>{one}</{element}>" for one in sorted(names)]
            lines.append(f"          </{group}>")
    return [*lines, "        </profile>"]


def _operator() -> list[str]:
    rules = ("topics", "topic", "subscribe"), ("services", "service", "request"), ("actions", "action", "call")
    lines = [f"    <enclave path={quoteattr(f'/vergence/{OPERATOR}')}>", "      <profiles>"]
    lines.append('        <profile ns="/" node="*">')
    lines += ['          <topics publish="ALLOW">']
    lines += [f"            <topic>{name}</topic>" for name in OPERATOR_TOPICS]
    lines += ["            <topic>/parameter_events</topic>", "          </topics>"]
    for group, element, verb in rules:
        lines += [
            f'          <{group} {verb}="ALLOW">',
            f"            <{element}>*</{element}>",
            f"          </{group}>",
        ]
    return [*lines, "        </profile>", "      </profiles>", "    </enclave>"]
