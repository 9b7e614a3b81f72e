"""One line in a node's log about the inputs that it still waits for, soon after its start."""

from collections.abc import Callable, Sequence

from rclpy.clock import Clock, ClockType
from rclpy.node import Node

NOTICE_AFTER_S = 1.5
"""Long enough for discovery on one machine, and for a camera that runs already."""


def report_awaited(node: Node, awaited: Callable[[], Sequence[str]], sources: str) -> None:
    """Log once, shortly after the start, which topics have brought nothing yet.

    Args:
        node: whose log it is.
        awaited: returns the topics without a message so far, as subscribed.
        sources: who publishes them, and how it is started.
    """

    def report() -> None:
        timer.cancel()
        silent = [node.resolve_topic_name(topic) for topic in awaited()]
        if silent:
            node.get_logger().info(waiting_text({topic: node.count_publishers(topic) for topic in silent}, sources))

    timer = node.create_timer(NOTICE_AFTER_S, report, clock=Clock(clock_type=ClockType.STEADY_TIME))


def waiting_text(publishers: dict[str, int], sources: str) -> str:
    """Return the line for topics without a message, with the number of publishers that each has."""
    topics = " and ".join(publishers)
    if not any(publishers.values()):
        return (
            f"waiting for {topics}: nothing publishes there. {sources}. If one runs: it needs the same ROS_DOMAIN_ID "
            f"and namespace, or a remapping (-r {next(iter(publishers))}:=/its/topic)"
        )
    mute = ", ".join(f"{topic} {count}" for topic, count in publishers.items())
    return (
        f"waiting for {topics}: no message yet (publishers: {mute}). The publisher may still start, or its log or "
        "/diagnostics says what it lacks ('vergence watch' shows both); raw images need the Fast DDS profile "
        "(FASTRTPS_DEFAULT_PROFILES_FILE) on both sides"
    )
