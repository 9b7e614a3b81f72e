"""Images handed over in memory, by topic."""

import numpy as np
from std_msgs.msg import Header

from vergence_common.local_images import LocalImages


def test_every_receiver_of_a_topic_gets_the_very_image() -> None:
    images, got = LocalImages(), list[tuple[str, object, object]]()
    assert not images.offers("/left/image_raw")
    images.offer("/left/image_raw")
    assert not images.wanted("/left/image_raw")
    images.receive("/left/image_raw", lambda header, pixels: got.append(("a", header, pixels)))
    images.receive("/left/image_raw", lambda header, pixels: got.append(("b", header, pixels)))
    assert images.wanted("/left/image_raw")
    header, pixels = Header(frame_id="left"), np.zeros((2, 3), np.uint8)
    images.deliver("/left/image_raw", header, pixels)
    assert [(name, one is header, two is pixels) for name, one, two in got] == [("a", True, True), ("b", True, True)]


def test_what_is_not_wanted_has_no_receiver() -> None:
    images = LocalImages()
    images.deliver("/left/image_raw", Header(), np.zeros((2, 3), np.uint8))
    assert not images.wanted("/left/image_raw")
