"""Messages that are put together by hand are those that the middleware would have made."""

import pytest
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import CompressedImage
from std_msgs.msg import Header

from vergence_camera.ros.camera_messages import JpegSerializer
from vergence_common.stamps import from_nanoseconds

pytestmark = pytest.mark.graph


@pytest.mark.parametrize("frame_id", ["", "a", "abc", "abcd", "left_camera_optical_frame", "äöü"])
@pytest.mark.parametrize("size", [0, 1, 1001])
def test_the_serialised_message_is_what_the_middleware_makes(frame_id: str, size: int) -> None:
    data = bytes(range(256)) * 4
    stamp_ns = 1_795_369_597_195_928_723
    message = CompressedImage(header=Header(stamp=from_nanoseconds(stamp_ns), frame_id=frame_id), format="jpeg")
    message.data = data[:size]
    serialised = JpegSerializer(frame_id)(data[:size], stamp_ns)
    assert deserialize_message(serialised, CompressedImage) == message
    # In between and at the end the middleware pads with whatever lay in its memory.
    assert len(serialize_message(message)) - len(serialised) in range(4)
