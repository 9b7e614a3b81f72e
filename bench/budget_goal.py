"""`python -m bench.budget_goal`: lets the controller look at the middle of the left image; ends once it does."""

import sys
import time
from typing import Any

import rclpy
from rclpy.action import ActionClient
from rclpy.node import Node

from vergence_msgs.action import LookAt

WITHIN_S = 30.0
_AGAIN_S = 0.5


def main() -> int:
    """Send the goal; 0 if it was accepted in time."""
    rclpy.init()
    node = rclpy.create_node("budget_goal")
    client = ActionClient(node, LookAt, "gaze/look_at")
    end_s = time.monotonic() + WITHIN_S
    looks = client.wait_for_server(WITHIN_S) and _looks(node, client, end_s)
    rclpy.try_shutdown()
    return 0 if looks else 1


def _looks(node: Node, client: Any, end_s: float) -> bool:
    """Send the goal until it is not refused: a controller that has just started has no joint states yet."""
    while time.monotonic() < end_s:
        sent = client.send_goal_async(LookAt.Goal(kind=LookAt.Goal.PIXEL, eye=0, left_x_px=319.5, left_y_px=239.5))
        rclpy.spin_until_future_complete(node, sent, timeout_sec=end_s - time.monotonic())
        if not sent.done():
            return False
        if not sent.result().accepted:
            time.sleep(_AGAIN_S)
            continue
        ended = sent.result().get_result_async()
        rclpy.spin_until_future_complete(node, ended, timeout_sec=1.0)
        if not (ended.done() and ended.result().result.result == LookAt.Result.INVALID):
            return True
    return False


if __name__ == "__main__":
    sys.exit(main())
