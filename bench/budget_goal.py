"""`python -m bench.budget_goal`: lets the controller look at the middle of the left image; ends once that began."""

import sys
import time

import rclpy
from rclpy.action import ActionClient

from vergence_msgs.action import LookAt

WITHIN_S = 30.0


def main() -> int:
    """Send the goal; 0 if it was accepted in time."""
    rclpy.init()
    node = rclpy.create_node("budget_goal")
    client = ActionClient(node, LookAt, "gaze/look_at")
    end_s = time.monotonic() + WITHIN_S
    accepted = False
    if client.wait_for_server(WITHIN_S):
        sent = client.send_goal_async(LookAt.Goal(kind=LookAt.Goal.PIXEL, eye=0, left_x_px=319.5, left_y_px=239.5))
        while not sent.done() and time.monotonic() < end_s:
            rclpy.spin_once(node, timeout_sec=0.1)
        accepted = sent.done() and sent.result().accepted
    rclpy.try_shutdown()
    return 0 if accepted else 1


if __name__ == "__main__":
    sys.exit(main())
