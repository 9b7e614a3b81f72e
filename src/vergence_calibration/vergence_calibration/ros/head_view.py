"""The running head for the visual calibration: commands a pose, returns the images after it."""

import time
from collections.abc import Callable, Mapping

from sensor_msgs.msg import Image

from vergence_calibration.eye_turn import Image as Pixels
from vergence_calibration.ros.running_head import EYES, HeadError, RunningHead
from vergence_common.images import image_to_array
from vergence_common.qos import IMAGE_QOS
from vergence_common.stamps import to_nanoseconds
from vergence_rig.camera import CameraModel
from vergence_rig.rig import JOINT_NAMES

_SETTLE_S = 0.5
_TIMEOUT_S = 15.0
_FIRST_TIMEOUT_S = 45.0


class HeadView(RunningHead):
    """Commands whole poses and returns both eyes' images at rest there."""

    def __init__(self, namespace: str = "") -> None:
        super().__init__("calibrate_servos", namespace)
        self._images: dict[str, Image] = {}
        for eye in EYES:
            self.node.create_subscription(Image, f"{eye}/image_raw", self._store_image(eye), IMAGE_QOS)

    def camera_models(self) -> dict[str, CameraModel]:
        """Return the models of the cameras that publish a calibration, once images come. Raises HeadError."""
        self._wait_for_images(0, _FIRST_TIMEOUT_S)
        return self.published_models()

    def look(self, joints_rad: Mapping[str, float]) -> dict[str, Pixels]:
        """Command the joints, wait until the eyes rest, return both eyes' images taken after that.

        Raises HeadError where no node subscribes to commands, another node publishes them, or no images come.
        """
        if self.node.count_publishers("joint_command") > 1:
            raise HeadError("another node commands the joints: stop gaze_controller_node first")
        self.wait_for_servos(_TIMEOUT_S)
        self.command({name: joints_rad.get(name, 0.0) for name in JOINT_NAMES})
        time.sleep(_SETTLE_S)
        return self._wait_for_images(self.node.get_clock().now().nanoseconds)

    def _wait_for_images(self, after_ns: int, timeout_s: float = _TIMEOUT_S) -> dict[str, Pixels]:
        def fresh() -> bool:
            stamps = [to_nanoseconds(self._images[eye].header.stamp) for eye in EYES if eye in self._images]
            return len(stamps) == len(EYES) and min(stamps) > after_ns

        with self.arrival:
            if not self.arrival.wait_for(fresh, timeout_s):
                raise HeadError(f"no fresh left/image_raw and right/image_raw for {timeout_s:g} s")
            return {eye: image_to_array(image) for eye, image in self._images.items()}

    def _store_image(self, eye: str) -> Callable[[Image], None]:
        def store(message: Image) -> None:
            with self.arrival:
                self._images[eye] = message
                self.arrival.notify_all()

        return store
