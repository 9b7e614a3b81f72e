"""The QoS profiles, and a diagnostic that names every incompatible publisher and subscriber."""

from collections import Counter
from collections.abc import Callable
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

IMAGE_QOS = QoSProfile(history=QoSHistoryPolicy.KEEP_LAST, depth=2, reliability=QoSReliabilityPolicy.RELIABLE)
STATE_QOS = QoSProfile(history=QoSHistoryPolicy.KEEP_LAST, depth=10, reliability=QoSReliabilityPolicy.RELIABLE)


def overridable() -> QoSOverridingOptions:
    """Let users override history, depth and reliability by the `qos_overrides` parameters."""
    return QoSOverridingOptions.with_default_policies()


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
            self._count(topic, "a subscriber requests more than the publisher offers", event.last_policy_kind)

        return self._node.create_publisher(
            message_type,
            topic,
            qos,
            qos_overriding_options=overridable(),
            event_callbacks=PublisherEventCallbacks(incompatible_qos=mismatch, matched=matched),
        )

    def create_subscription(
        self, message_type: Any, topic: str, callback: Callable[[Any], None], qos: QoSProfile = STATE_QOS
    ) -> Subscription:
        """As Node.create_subscription, overridable and watched."""

        def mismatch(event: QoSRequestedIncompatibleQoSInfo) -> None:
            self._count(topic, "a publisher offers less than the subscriber requests", event.last_policy_kind)

        return self._node.create_subscription(
            message_type,
            topic,
            callback,
            qos,
            qos_overriding_options=overridable(),
            event_callbacks=SubscriptionEventCallbacks(incompatible_qos=mismatch),
        )

    def report(self) -> Report:
        """Return the diagnostic: every mismatch seen since the start, by topic and policy."""
        if not self._mismatches:
            return Report(OK, "all QoS profiles are compatible")
        return Report(WARN, "; ".join(self._mismatches), dict(self._mismatches))

    def _count(self, topic: str, what: str, policy: int) -> None:
        name = QoSPolicyKind(policy).name.lower()
        text = f"{topic}: {what} ({name}); set qos_overrides.{topic}.*.{name} on one side"
        if not self._mismatches[text]:
            self._node.get_logger().warning(text)
        self._mismatches[text] += 1


def watch_qos(node: Node, diagnostics: Diagnostics) -> QosWatch:
    """Return a QosWatch that reports into `diagnostics`."""
    return QosWatch(node, diagnostics)
