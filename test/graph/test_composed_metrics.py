"""Metric nodes in one process: images are subscribed once, by the first, or taken from a camera of the process."""

from functools import partial
from typing import Any

import cv2
import numpy as np
from sensor_msgs.msg import Image
from std_msgs.msg import Header

from vergence_common.images import array_to_image
from vergence_common.local_images import LocalImages
from vergence_common.qos import IMAGE_QOS
from vergence_common.stamps import from_nanoseconds, to_nanoseconds
from vergence_metric.ros import metric_node
from vergence_metric.ros.edge_metric_node import EdgeMetricNode
from vergence_metric.ros.eye_rotation_node import EyeRotationNode
from vergence_msgs.msg import EyeRotation, VergenceError

FIRST_NS, PERIOD_NS = 5_000_000_000, 33_000_000


def views(shift_px: int) -> list[np.ndarray]:
    noise = cv2.GaussianBlur(np.random.default_rng(7).normal(size=(240, 400, 1)), (0, 0), 2.5)
    scene = np.clip(125 + 45 * noise / noise.std(), 0, 255).astype(np.uint8)
    colour = cv2.cvtColor(scene, cv2.COLOR_GRAY2BGR)
    return [np.ascontiguousarray(colour[:, x : x + 320]) for x in (40, 40 + shift_px)]


def stamped(number: int, frame: str) -> Header:
    return Header(stamp=from_nanoseconds(FIRST_NS + number * PERIOD_NS), frame_id=frame)


def test_images_are_subscribed_once_and_shared(graph: Any) -> None:
    images = LocalImages()
    edge = graph.start(partial(EdgeMetricNode, images=images))
    rotation = graph.start(partial(EyeRotationNode, images=images))
    topics = [f"{eye}/image_raw" for eye in ("left", "right")]
    publishers = [graph.client.create_publisher(Image, topic, IMAGE_QOS) for topic in topics]
    error, turned = graph.message(VergenceError, "vergence/error"), graph.message(EyeRotation, "vergence/eye_rotation")
    graph.wait_until(lambda: all(p.get_subscription_count() == 1 for p in publishers), "one subscription for each eye")
    graph.wait_until(lambda: graph.client.count_publishers("vergence/eye_rotation") > 0, "both nodes are known")
    for number in range(30):
        for publisher, pixels, topic in zip(publishers, views(6), topics, strict=True):
            publisher.publish(array_to_image(pixels, stamped(number, topic)))
        graph.executor.spin_once(timeout_sec=0.05)
    assert abs(graph.wait(error).horizontal_px - 6.0) < 0.1
    assert to_nanoseconds(graph.wait(turned).header.stamp) >= FIRST_NS
    assert edge.count_subscribers("left/image_raw") == rotation.count_subscribers("left/image_raw") == 1


def test_images_of_the_process_are_not_subscribed(graph: Any) -> None:
    images = LocalImages()
    for eye in ("left", "right"):
        images.offer(f"/{eye}/image_raw")
    node = graph.start(partial(EdgeMetricNode, images=images))
    error = graph.message(VergenceError, "vergence/error")
    graph.wait_until(lambda: node._error_publisher.get_subscription_count() > 0, "our subscription is known")
    for number in range(10):
        for eye, pixels in zip(("left", "right"), views(-4), strict=True):
            images.deliver(f"/{eye}/image_raw", stamped(number, eye), pixels)
        graph.executor.spin_once(timeout_sec=0.05)
    assert abs(graph.wait(error).horizontal_px + 4.0) < 0.1
    assert node.count_subscribers("left/image_raw") == 0


def test_without_subscribers_of_its_outputs_a_node_soon_receives_no_images(graph: Any, monkeypatch: Any) -> None:
    monkeypatch.setattr(metric_node, "_UNHEARD_S", 0.0)
    node = graph.start(EdgeMetricNode)
    publishers = [graph.client.create_publisher(Image, f"{eye}/image_raw", IMAGE_QOS) for eye in ("left", "right")]
    graph.diagnostic("outputs", lambda status: "nothing is measured" in status.message)
    graph.wait_until(lambda: not any(p.get_subscription_count() for p in publishers), "no subscription of images")
    error = graph.message(VergenceError, "vergence/error")
    graph.wait_until(lambda: node._error_publisher.get_subscription_count() > 0, "our subscription is known")
    graph.wait_until(lambda: all(p.get_subscription_count() for p in publishers), "images are subscribed again")
    for number in range(10):
        for publisher, eye, pixels in zip(publishers, ("left", "right"), views(5), strict=True):
            publisher.publish(array_to_image(pixels, stamped(number, eye)))
        graph.executor.spin_once(timeout_sec=0.05)
    assert abs(graph.wait(error).horizontal_px - 5.0) < 0.1
