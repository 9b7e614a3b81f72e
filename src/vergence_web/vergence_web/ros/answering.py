"""What a page asks for must never end the node: whatever fails is the answer."""

from collections.abc import Callable
from typing import Any

from rclpy.node import Node

from vergence_web.requests import Answer, Message

Reply = Callable[[Answer], None]


def answering(node: Node, message: Message, reply: Reply, call: Callable[..., None]) -> Callable[..., None]:
    """Return a call that answers a request as failed, and logs why, where `call` raises."""

    def guarded(*arguments: Any) -> None:
        try:
            call(*arguments)
        except Exception as error:
            text = f"{type(error).__name__}: {error}"
            node.get_logger().error(f"a request of a page failed: {text}")
            reply(Answer(message.number, False, f"the request failed: {text[:500]}"))

    return guarded
