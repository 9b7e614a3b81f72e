"""Which nodes command the servos: two at once are a mistake that no single node can detect."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Commander:
    """One publisher of a command topic: its node, and the identity that DDS gives it."""

    node: str
    identity: bytes


def conflict(publishers: Mapping[str, Iterable[Commander]]) -> str:
    """Return a sentence that names the commanders where there are two or more, else "".

    Args:
        publishers: by topic. One node that publishes on several topics is one commander; two publishers of one topic
            are two, even if their nodes are called the same.
    """
    nodes: set[tuple[str, object]] = set()
    for commanders in publishers.values():
        seen: dict[str, int] = {}
        for commander in commanders:
            seen[commander.node] = seen.get(commander.node, 0) + 1
            nodes.add((commander.node, seen[commander.node]))
    if len(nodes) < 2:
        return ""
    places = [f"{commander.node} on {topic}" for topic, commanders in publishers.items() for commander in commanders]
    return (
        f"{len(nodes)} commanders at once: {', '.join(sorted(places))}; the servos follow both in turn "
        f"(a killed node stays listed for 10 s)"
    )
