"""Images handed from node to node inside one process, without messages."""

import threading
from collections.abc import Callable

import numpy as np
import numpy.typing as npt
from std_msgs.msg import Header

Pixels = npt.NDArray[np.uint8]
Receive = Callable[[Header, Pixels], None]


class LocalImages:
    """By topic: whether a node of this process has the images, and who receives them.

    Receivers are called one at a time, in the thread of whoever delivers, and must only hand the image on; the pixels
    are shared and must not be written to.
    """

    def __init__(self) -> None:
        self.lock = threading.RLock()
        """Held while receivers are called: what they change may be changed elsewhere only under it."""
        self._receivers: dict[str, list[Receive]] = {}

    def offer(self, topic: str) -> None:
        """State that the images of a topic, by its full name, will be delivered here."""
        self._receivers.setdefault(topic, [])

    def offers(self, topic: str) -> bool:
        """Return whether a topic's images are delivered here."""
        return topic in self._receivers

    def receive(self, topic: str, receiver: Receive) -> None:
        """Call `receiver` with each image of a topic that is offered."""
        self._receivers[topic].append(receiver)

    def remove(self, topic: str, receiver: Receive) -> None:
        """Call `receiver` with no further image of a topic."""
        with self.lock:
            self._receivers[topic].remove(receiver)

    def wanted(self, topic: str) -> bool:
        """Return whether a topic's images have a receiver."""
        return bool(self._receivers.get(topic))

    def deliver(self, topic: str, header: Header, pixels: Pixels) -> None:
        """Hand an image, (h, w, 3) BGR or (h, w) grey, to all receivers of its topic."""
        with self.lock:
            for receiver in self._receivers.get(topic, ()):
                receiver(header, pixels)
