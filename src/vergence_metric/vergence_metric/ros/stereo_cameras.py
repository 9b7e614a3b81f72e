"""The cameras of a pair: as camera_info describes them, or else rig.yaml, and the ideal images that follow from it."""

from collections.abc import Callable
from typing import Any

from sensor_msgs.msg import CameraInfo

from vergence_common.diagnostics import ERROR, OK, WARN, Report
from vergence_metric.edges.edges import to_grey
from vergence_metric.pairs.ideal_images import IdealImages, Models
from vergence_metric.pairs.pairing import LEFT, RIGHT
from vergence_metric.ros.image_pair import SIDES, IdealPair, ImagePair
from vergence_rig.camera import CameraModel, CameraModelError
from vergence_rig.eye_image import EyeImage
from vergence_rig.rig import Rig

SizeOf = Callable[[int], tuple[int, int] | None]
"""Width and height of the images of a side [px]; None before the first."""


class StereoCameras:
    """`models` holds the left and the right camera model by camera_info, None before the first."""

    def __init__(self, rig: Rig, logger: Any, size_px: SizeOf) -> None:
        self.models: list[CameraModel | None] = [None, None]
        self.eye_images: tuple[EyeImage, EyeImage] | None = None
        """How the images of the newest pair map to ideal ones; None before the first, or without known cameras."""
        self._ideal, self._logger, self._size_px = IdealImages(rig), logger, size_px
        self._info_errors: list[str | None] = [None, None]

    def on_info(self, side: int, message: CameraInfo) -> None:
        """Use the camera that a camera_info describes."""
        seen = (message.width, message.height, tuple(message.k), tuple(message.d), message.distortion_model)
        try:
            self.models[side] = CameraModel.from_camera_info_values(*seen)
            self._info_errors[side] = None
        except CameraModelError as error:
            self.models[side] = None
            self._info_errors[side] = str(error)
            self._logger.warning(f"{self._fault(side)[1]}")

    def cameras_of(self, pair: ImagePair) -> Models | None:
        """Return both cameras of a pair, by camera_info or else by rig.yaml; None where neither has that image size."""
        try:
            return self._ideal.cameras((self.models[LEFT], self.models[RIGHT]), (pair.left.pixels, pair.right.pixels))
        except ValueError:
            return None

    def calibrated(self, pair: ImagePair) -> Models | None:
        """Return both cameras of a pair if camera_info describes them for images of this size, else None."""
        cameras, (left, right) = self.cameras_of(pair), self.models
        return cameras if cameras is not None and cameras[0] is left and cameras[1] is right else None

    def ideal(self, pair: ImagePair, grey: bool = False) -> IdealPair:
        """Return a pair as ideal cameras would take it, or as it is where the cameras are not known."""
        pictures = (pair.left.pixels, pair.right.pixels)
        left, right = (to_grey(pixels) for pixels in pictures) if grey else pictures
        cameras = self.cameras_of(pair)
        if cameras is None:
            return IdealPair(left, right, None)
        self.eye_images = self._ideal.set_cameras(cameras)
        return IdealPair(*self._ideal.draw(left, right), self.eye_images, self._ideal.seen_px)

    def report(self) -> Report:
        """Return the diagnostic of both cameras."""
        faults = [(self._info_errors[side] is not None, *self._fault(side)) for side in (LEFT, RIGHT)]
        # Of two as bad, what was refused tells more than what has not come.
        _, level, text = max(faults, key=lambda one: (one[1], one[0]))
        return Report(level, text) if text else Report(OK, "camera_info received from both cameras")

    def _fault(self, side: int) -> tuple[int, str]:
        """Return level and text of what is wrong with a camera's description; OK and "" if nothing is."""
        topic, model, size = f"{SIDES[side]}/camera_info", self.models[side], self._size_px(side)
        if model is not None and size in (None, (model.width_px, model.height_px)):
            return OK, ""
        if model is not None and size is not None:
            level, fault = ERROR, f"must be for {size[0]}x{size[1]} images: got {model.width_px}x{model.height_px}"
        else:
            level, fault = WARN, self._info_errors[side] or "no message yet"
        if size is not None and not self._ideal.describes(side == LEFT, *size):
            return ERROR, f"{topic}: {fault}; rig.yaml describes another image shape too: angles are NaN"
        return level, f"{topic}: {fault}; rig.yaml's description of the camera is used"
