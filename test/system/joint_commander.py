"""A small controller as a process of its own: publishes joint_command and says what it sees.

    python joint_commander.py steady ANGLE_RAD [JOINT...]    50 commands a second until it is ended; of pan_left
    python joint_commander.py latency PIPE COUNT      commands one at a time; each is awaited in PIPE

Prints one line of JSON when it has been matched, and one when it is done.
"""

import json
import os
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.publisher import Publisher
from sensor_msgs.msg import JointState

PERIOD_S = 0.02


def publish(node: Node, publisher: Publisher, angle_rad: float, joints: Sequence[str] = ("pan_left",)) -> None:
    message = JointState(name=list(joints), position=[angle_rad] * len(joints))
    message.header.stamp = node.get_clock().now().to_msg()
    publisher.publish(message)


def latencies_ms(node: Node, publisher: Publisher, pipe: int, count: int) -> list[float]:
    found = []
    for i in range(count):
        time.sleep(PERIOD_S)
        os.set_blocking(pipe, False)
        while _pending(pipe):
            pass
        os.set_blocking(pipe, True)
        started_s = time.monotonic()
        publish(node, publisher, 0.002 * (1 + i % 5))
        os.read(pipe, 64)
        found.append(1000 * (time.monotonic() - started_s))
    return found


def _pending(pipe: int) -> bool:
    try:
        return bool(os.read(pipe, 4096))
    except BlockingIOError:
        return False


def main() -> None:
    rclpy.init()
    node = Node("joint_commander")
    publisher = node.create_publisher(JointState, "joint_command", 10)
    states: list[JointState] = []
    node.create_subscription(JointState, "joint_states", states.append, 10)
    started_s = time.monotonic()
    while not (publisher.get_subscription_count() and states):
        rclpy.spin_once(node, timeout_sec=0.1)
    print(json.dumps({"matched_s": time.monotonic() - started_s}), flush=True)
    if sys.argv[1] == "latency":
        pipe = os.open(Path(sys.argv[2]), os.O_RDWR)
        publish(node, publisher, 0.0)
        time.sleep(0.3)
        print(json.dumps({"latencies_ms": latencies_ms(node, publisher, pipe, int(sys.argv[3]))}), flush=True)
        return
    while True:
        publish(node, publisher, float(sys.argv[2]), sys.argv[3:] or ("pan_left",))
        rclpy.spin_once(node, timeout_sec=PERIOD_S)


if __name__ == "__main__":
    with suppress(KeyboardInterrupt, ExternalShutdownException):
        main()
