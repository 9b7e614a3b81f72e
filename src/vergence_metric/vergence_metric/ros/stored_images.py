"""Pairs of images of the last second, asked for at the cameras: for a node that does not receive them all."""

from collections.abc import Callable
from functools import partial
from time import monotonic_ns
from typing import Any

from rclpy.node import Node
from sensor_msgs.msg import CompressedImage

from vergence_common.images import ImageError, compressed_to_array
from vergence_common.stamps import to_nanoseconds
from vergence_metric.pairs.pairing import LEFT, RIGHT, Pair
from vergence_metric.ros.image_pair import SIDES, ImageFrame, ImagePair
from vergence_msgs.srv import GetStoredImage


class StoredImages:
    """Clients of both cameras' service `get_stored_image`."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._clients = [node.create_client(GetStoredImage, f"{side}/get_stored_image") for side in SIDES]

    @property
    def available(self) -> bool:
        """True if both cameras hand out their images."""
        return all(client.service_is_ready() for client in self._clients)

    def get(self, stamp: Any, on_pair: Callable[[ImagePair | None], None]) -> None:
        """Call `on_pair`, in the executor's thread, with the images nearest to a stamp, or None if there are none."""
        answers: list[ImageFrame | None] = [None, None]
        waiting = {LEFT, RIGHT}

        def on_answer(side: int, future: Any) -> None:
            answers[side] = self._frame(side, future.result())
            waiting.discard(side)
            left, right = answers
            if waiting:
                return
            if left is None or right is None:
                on_pair(None)
                return
            stamps_ns = [to_nanoseconds(frame.header.stamp) for frame in (left, right)]
            on_pair(Pair(left, right, *stamps_ns))

        for side, client in enumerate(self._clients):
            client.call_async(GetStoredImage.Request(stamp=stamp)).add_done_callback(partial(on_answer, side))

    def _frame(self, side: int, answer: GetStoredImage.Response) -> ImageFrame | None:
        if not answer.found:
            return None
        try:
            pixels = compressed_to_array(CompressedImage(format="jpeg", data=answer.jpeg))
            return ImageFrame(answer.header, pixels, monotonic_ns())
        except ImageError as error:
            self._node.get_logger().warning(f"{SIDES[side]}/get_stored_image: {error}", throttle_duration_sec=5.0)
            return None
