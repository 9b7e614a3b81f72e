"""The service that hands out images of the last second, so that a reader need not receive them all to have one."""

from collections import deque
from collections.abc import Callable

from rclpy.node import Node
from std_msgs.msg import Header

from vergence_camera.errors import CorruptFrameError
from vergence_camera.frame import Encoding, Frame
from vergence_common.stamps import from_nanoseconds, to_nanoseconds
from vergence_msgs.srv import GetStoredImage

SERVICE = "get_stored_image"
_KEEP_NS = 1_200_000_000
_APART_NS = 150_000_000  # of frames that are not JPEG, which are ten times as large


class StoredImages:
    """Keeps the frames of the last second as the camera gave them; they become JPEG only when one is asked for."""

    def __init__(self, node: Node, frame_id: str, to_jpeg: Callable[[Frame], bytes]) -> None:
        self._frame_id, self._to_jpeg = frame_id, to_jpeg
        self._kept: deque[tuple[int, Frame]] = deque(maxlen=300)
        self._service = node.create_service(GetStoredImage, SERVICE, self._on_request)

    def add(self, stamp_ns: int, frame: Frame) -> None:
        """Keep a frame; called in the capture thread."""
        kept = self._kept
        if kept and stamp_ns <= kept[-1][0]:
            kept.clear()  # the clock was set
        is_jpeg = isinstance(frame.data, bytes) and frame.encoding is Encoding.JPEG
        if not is_jpeg and kept and stamp_ns - kept[-1][0] < _APART_NS:
            return
        kept.append((stamp_ns, frame))
        while kept[0][0] < stamp_ns - _KEEP_NS:
            kept.popleft()

    def _on_request(
        self, request: GetStoredImage.Request, response: GetStoredImage.Response
    ) -> GetStoredImage.Response:
        wanted_ns = to_nanoseconds(request.stamp)
        for stamp_ns, frame in sorted(self._kept.copy(), key=lambda kept: abs(kept[0] - wanted_ns))[:1]:
            try:
                response.jpeg = self._to_jpeg(frame)
            except CorruptFrameError:
                break
            response.header = Header(stamp=from_nanoseconds(stamp_ns), frame_id=self._frame_id)
            response.found = True
        return response
