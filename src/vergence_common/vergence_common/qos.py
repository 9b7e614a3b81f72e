"""The QoS profiles, and a diagnostic that names every incompatible publisher and subscriber."""

import difflib
from collections import Counter
from collections.abc import Callable, Sequence
from copy import copy
from typing import Any

from rclpy.event_handler import (
    PublisherEventCallbacks,
    QoSOfferedIncompatibleQoSInfo,
    QoSPublisherMatchedInfo,
    QoSRequestedIncompatibleQoSInfo,
    SubscriptionEventCallbacks,
)
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSHistoryPolicy, QoSPolicyKind, QoSProfile, QoSReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.subscription import Subscription

from vergence_common.diagnostics import OK, WARN, Diagnostics, Report
from vergence_rig.parameters import UnknownParameterError

IMAGE_QOS = QoSProfile(history=QoSHistoryPolicy.KEEP_LAST, depth=2, reliability=QoSReliabilityPolicy.RELIABLE)
STATE_QOS = QoSProfile(history=QoSHistoryPolicy.KEEP_LAST, depth=10, reliability=QoSReliabilityPolicy.RELIABLE)

_PREFIX = "qos_overrides."

# The value that every other side is compatible with: what a publisher should offer, what a subscription should request.
_COMPATIBLE = {
    QoSPolicyKind.RELIABILITY: {"publisher": "reliable", "subscription": "best_effort"},
    QoSPolicyKind.DURABILITY: {"publisher": "transient_local", "subscription": "volatile"},
}


def overridable() -> QoSOverridingOptions:
    """Let users override history, depth, reliability and durability by the `qos_overrides` parameters."""
    return QoSOverridingOptions(policy_kinds=(QoSPolicyKind.HISTORY, QoSPolicyKind.DEPTH, *_COMPATIBLE))


class QosWatch:
    """Makes publishers and subscriptions whose QoS mismatches are counted and reported as one diagnostic."""

    def __init__(self, node: Node, diagnostics: Diagnostics) -> None:
        self._node = node
        self._mismatches: Counter[str] = Counter()
        diagnostics.add("qos", self.report)

    def create_publisher(
        self,
        message_type: Any,
        topic: str,
        qos: QoSProfile = STATE_QOS,
        matched: Callable[[QoSPublisherMatchedInfo], None] | None = None,
    ) -> Publisher:
        """As Node.create_publisher, overridable and watched; `matched` is called when a subscriber comes or goes."""

        def mismatch(event: QoSOfferedIncompatibleQoSInfo) -> None:
            what = "a subscriber requests more than the publisher offers"
            self._count(topic, "publisher", what, event.last_policy_kind)

        return self._node.create_publisher(
            message_type,
            topic,
            copy(qos),  # rclpy writes the overrides into it
            qos_overriding_options=overridable(),
            event_callbacks=PublisherEventCallbacks(incompatible_qos=mismatch, matched=matched),
        )

    def create_subscription(
        self,
        message_type: Any,
        topic: str,
        callback: Callable[[Any], None],
        qos: QoSProfile = STATE_QOS,
        serialised: bool = False,
    ) -> Subscription:
        """As Node.create_subscription, overridable and watched; `serialised` calls with bytes instead of messages."""

        def mismatch(event: QoSRequestedIncompatibleQoSInfo) -> None:
            what = "a publisher offers less than the subscriber requests"
            self._count(topic, "subscription", what, event.last_policy_kind)

        return self._node.create_subscription(
            message_type,
            topic,
            callback,
            copy(qos),
            qos_overriding_options=overridable(),
            event_callbacks=SubscriptionEventCallbacks(incompatible_qos=mismatch),
            raw=serialised,
        )

    def report(self) -> Report:
        """Return the diagnostic: every mismatch seen since the start, by topic and policy."""
        if not self._mismatches:
            return Report(OK, "all QoS profiles are compatible")
        return Report(WARN, "; ".join(self._mismatches), dict(self._mismatches))

    def _count(self, topic: str, side: str, what: str, policy: int) -> None:
        kind = QoSPolicyKind(policy)
        name, value = kind.name.lower(), _COMPATIBLE.get(kind, {}).get(side)
        full_topic = self._node.resolve_topic_name(topic)
        text = f"{topic}: {what} ({name})"
        if value is not None:
            text += f"; start this node with -p {_PREFIX}{full_topic}.{side}.{name}:={value}, or change the other side"
        if not self._mismatches[text]:
            self._node.get_logger().warning(text)
        self._mismatches[text] += 1


def watch_qos(node: Node, diagnostics: Diagnostics) -> QosWatch:
    """Return a QosWatch that reports into `diagnostics`."""
    return QosWatch(node, diagnostics)


def check_overrides(nodes: Sequence[Node]) -> None:
    """Raise ParameterError for a `qos_overrides` parameter that no publisher or subscription of these nodes reads."""
    known = {name for node in nodes for name in node._parameters if name.startswith(_PREFIX)}
    for node in nodes:
        for name, override in node._parameter_overrides.items():
            if not name.startswith(_PREFIX) or name in known or name.startswith(f"{_PREFIX}/clock."):
                continue
            close = difflib.get_close_matches(name, known, n=3) or sorted(known)
            raise UnknownParameterError(name, override.value, close)
