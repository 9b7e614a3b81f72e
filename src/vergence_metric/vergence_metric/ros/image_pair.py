"""A pair of images as it was received, and as ideal cameras would take it."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from std_msgs.msg import Header

from vergence_metric.pairs.ideal_images import Models
from vergence_metric.pairs.pairing import Pair
from vergence_rig.eye_image import EyeImage

SIDES = ("left", "right")


@dataclass(frozen=True, slots=True)
class ImageFrame:
    """One eye's image: header, pixels (h, w, 3) BGR or (h, w) grey uint8, and time of arrival [ns, monotonic]."""

    header: Header
    pixels: npt.NDArray[np.uint8]
    arrived_ns: int


ImagePair = Pair[ImageFrame]


@dataclass(frozen=True, slots=True)
class IdealPair:
    """Both eyes' ideal images, and how they map to the images as they were taken; None without known cameras."""

    left: npt.NDArray[np.uint8]
    right: npt.NDArray[np.uint8]
    eye_images: tuple[EyeImage, EyeImage] | None
    seen_px: int | None = None
    """Side of the largest square about the middle that both cameras saw; None where they saw all."""

    @property
    def cameras(self) -> Models | None:
        """The ideal cameras."""
        return self.eye_images and (self.eye_images[0].ideal, self.eye_images[1].ideal)
