"""Tries the middleware as nodes use it: a context, a node, and one message of an image's size to another process.

Run by `vergence doctor` in processes of its own, because the middleware may hang or end them. Every step that has
succeeded is one line on standard output; a failure is one line on standard error and status 1.
"""

import os
import subprocess
import sys
import time

import rclpy
from rclpy.node import Node
from sensor_msgs.msg import Image
from std_msgs.msg import Header

from vergence_common.images import array_to_image
from vergence_common.qos import IMAGE_QOS
from vergence_common.start import init, one_line

CONTEXT, NODE, IMAGE = "context", "node", "image"
"""The steps, in this order."""

WAIT_S = 8.0
"""Time for the image to arrive, discovery included [s]."""

_SIZE = (480, 640, 3)
_SEND, _RATE_HZ = "send", 10.0


def main(arguments: list[str]) -> int:
    """Receive, and run a second process of this module that sends; `send TOPIC` is that process."""
    try:
        init([])
        _say(CONTEXT)
        node = Node(f"vergence_doctor_{os.getpid()}")
        _say(NODE)
        if arguments[:1] == [_SEND]:
            return _send(node, arguments[1])
        return _receive(node)
    except Exception as error:  # whatever fails is what is looked for
        print(one_line(error), file=sys.stderr, flush=True)
        return 1


def _receive(node: Node) -> int:
    topic = f"vergence_doctor_{os.getpid()}"
    came: list[Image] = []
    node.create_subscription(Image, topic, came.append, IMAGE_QOS)
    sender = subprocess.Popen([sys.executable, "-m", __spec__.name, _SEND, topic], stdout=subprocess.DEVNULL)
    try:
        end_s = time.monotonic() + WAIT_S
        while not came and time.monotonic() < end_s:
            rclpy.spin_once(node, timeout_sec=0.2)
    finally:
        sender.kill()
        sender.wait()
    if not came:
        size = _SIZE[0] * _SIZE[1] * _SIZE[2]
        print(f"no image of {size} bytes arrived from another process within {WAIT_S:g} s", file=sys.stderr)
        return 1
    _say(IMAGE)
    return 0


def _send(node: Node, topic: str) -> int:
    import numpy as np

    publisher = node.create_publisher(Image, topic, IMAGE_QOS)
    message = array_to_image(np.zeros(_SIZE, np.uint8), Header())
    for _ in range(round(2 * WAIT_S * _RATE_HZ)):
        publisher.publish(message)
        time.sleep(1 / _RATE_HZ)
    return 0


def _say(step: str) -> None:
    print(step, flush=True)


if __name__ == "__main__":
    status = main(sys.argv[1:])
    sys.stderr.flush()
    os._exit(status)  # a middleware that hangs in its own end says nothing more
