"""One eye as a process: publishes image_raw on a timetable and prints the times of publication.

    python -m bench.graph_eye_publisher TOPIC SHIFT_PX

Prints `ready` when it has been matched, reads one line of JSON {start_ns, period_ns, offset_ns, count} (monotonic
time), publishes `count` images whose stamps follow the timetable, and prints one line of JSON: a list of [stamp_ns,
published_ns]. Stamps are monotonic time, so that both eyes and the receiver share one clock.
"""

import json
import sys
import time

import cv2
import numpy as np
import rclpy
from rclpy.node import Node
from rclpy.publisher import Publisher
from sensor_msgs.msg import Image
from std_msgs.msg import Header

from vergence_common.images import array_to_image
from vergence_common.memory import keep_large_blocks
from vergence_common.qos import IMAGE_QOS
from vergence_common.stamps import from_nanoseconds

WIDTH_PX, HEIGHT_PX, FRAMES = 640, 480, 8


def scene(shift_px: int, frame: int) -> "np.ndarray":
    """Return a view (480, 640, 3) BGR of a textured wall with objects, noise of its own, shifted to the left."""
    random = np.random.default_rng(7)
    wide = np.full((HEIGHT_PX, WIDTH_PX + 256, 3), 110, np.uint8)
    for _ in range(140):
        corner = random.integers(0, (WIDTH_PX + 256, HEIGHT_PX))
        size = random.integers(12, 90, 2)
        colour = tuple(int(value) for value in random.integers(20, 236, 3))
        cv2.rectangle(wide, tuple(int(v) for v in corner), tuple(int(v) for v in corner + size), colour, -1)
    view = wide[:, 128 + shift_px : 128 + shift_px + WIDTH_PX]
    noise = np.random.default_rng(1000 * shift_px + frame).normal(0.0, 2.0, view.shape)
    return np.asarray(np.clip(view + noise, 0, 255).astype(np.uint8))


def publish_on_time(publisher: Publisher, messages: list[Image], timetable: dict[str, int]) -> list[tuple[int, int]]:
    """Publish `count` images, each at its time; return stamps and times of publication [ns]."""
    sent = []
    for i in range(timetable["count"]):
        stamp_ns = timetable["start_ns"] + timetable["offset_ns"] + i * timetable["period_ns"]
        message = messages[i % len(messages)]
        message.header.stamp = from_nanoseconds(stamp_ns)
        time.sleep(max(0.0, (stamp_ns - time.monotonic_ns()) * 1e-9))
        published_ns = time.monotonic_ns()
        publisher.publish(message)
        sent.append((stamp_ns, published_ns))
    return sent


def main() -> None:
    """Run; see the module's text."""
    topic, shift_px = sys.argv[1], int(sys.argv[2])
    keep_large_blocks()  # as every node of ours does
    rclpy.init()
    node = Node("eye_publisher")
    publisher = node.create_publisher(Image, topic, IMAGE_QOS)
    messages = [array_to_image(scene(shift_px, i), Header(frame_id="eye")) for i in range(FRAMES)]
    while publisher.get_subscription_count() < 1:
        time.sleep(0.05)
    print("ready", flush=True)
    sent = publish_on_time(publisher, messages, json.loads(sys.stdin.readline()))
    print(json.dumps(sent), flush=True)
    sys.stdin.readline()  # a reliable publisher must live until the last image was taken
    node.destroy_node()
    rclpy.shutdown()


if __name__ == "__main__":
    main()
