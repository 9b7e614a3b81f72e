"""The rotation of an eye between two of its images."""

import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from vergence_rig.camera import CameraModel

Image = npt.NDArray[np.uint8]
_FEATURES = 400
_LEAST_FEATURES = 25
_FLOW = {"winSize": (25, 25), "maxLevel": 4}
_FORWARD_BACKWARD_PX = 0.5
# atan(x/z) differs from the eye's rotation off the image's centre, and eyes do not turn about their optical centres
_AGREE_RAD, _AGREE_SHARE = math.radians(0.15), 0.12


class NoMotionSeenError(ValueError):
    """Images with too few features, or too few that were found again."""


@dataclass(frozen=True)
class EyeTurn:
    """An eye's rotation, pan > 0 left, tilt > 0 down [rad], from `features` features.

    `agreement` is the share of the features that moved with the median: less where something in view moves by itself.
    """

    pan_rad: float
    tilt_rad: float
    features: int
    agreement: float


class ReferenceImage:
    """One image of an eye, (h, w) or (h, w, 3) uint8, whose features are tracked into its other images.

    Raises NoMotionSeenError where the image has too little texture.
    """

    def __init__(self, image: Image, camera: CameraModel) -> None:
        self._grey, self._camera = _grey(image), camera
        start = cv2.goodFeaturesToTrack(self._grey, _FEATURES, 0.01, 9)
        count = 0 if start is None else len(start)
        if count < _LEAST_FEATURES:
            raise NoMotionSeenError(f"the image must have {_LEAST_FEATURES} or more features: got {count}")
        self._start = np.asarray(start, np.float32).reshape(-1, 1, 2)
        self._angles = camera.angles(self._start.reshape(-1, 2))

    def turn(self, after: Image) -> EyeTurn:
        """Return how the eye turned from this image to `after`.

        Features are tracked forward and backward by pyramidal Lucas-Kanade flow; the median of their changes of
        direction is robust against moving things and, in part, against parallax. Raises NoMotionSeenError.
        """
        first, second, start = self._grey, _grey(after), self._start
        guess = start + np.array(_coarse_shift(first, second), np.float32)
        flow: dict[str, Any] = _FLOW
        there, found, _ = cv2.calcOpticalFlowPyrLK(
            first, second, start, guess.copy(), flags=cv2.OPTFLOW_USE_INITIAL_FLOW, **flow
        )
        back, found_back, _ = cv2.calcOpticalFlowPyrLK(
            second, first, there, start.copy(), flags=cv2.OPTFLOW_USE_INITIAL_FLOW, **flow
        )
        distance_px = np.linalg.norm((back - start).reshape(-1, 2), axis=1)
        good = (found.ravel() == 1) & (found_back.ravel() == 1) & (distance_px < _FORWARD_BACKWARD_PX)
        if good.sum() < _LEAST_FEATURES:
            raise NoMotionSeenError(f"{_LEAST_FEATURES} or more features must be found again: got {int(good.sum())}")
        turned = self._camera.angles(there.reshape(-1, 2)[good]) - self._angles[good]
        middle = np.median(turned, axis=0)
        near = np.abs(turned - middle).max(axis=1) < _AGREE_RAD + _AGREE_SHARE * float(np.abs(middle).max())
        # the world moves to the right when the eye turns left, and up when it turns down
        return EyeTurn(float(middle[0]), float(-middle[1]), int(good.sum()), float(near.mean()))


def eye_turn(before: Image, after: Image, camera: CameraModel) -> EyeTurn:
    """Return the rotation from `before` to `after`, (h, w) or (h, w, 3) uint8 of one camera. See ReferenceImage."""
    return ReferenceImage(before, camera).turn(after)


def azimuth_difference(left: Image, right: Image, left_camera: CameraModel, right_camera: CameraModel) -> float:
    """Return the median azimuth of matched features, left minus right [rad]."""
    finder = cv2.ORB.create(1500)
    left_points, left_words = finder.detectAndCompute(_grey(left), None)
    right_points, right_words = finder.detectAndCompute(_grey(right), None)
    if left_words is None or right_words is None:
        raise NoMotionSeenError("one of the images has no features to match")
    matches = cv2.BFMatcher(cv2.NORM_HAMMING, crossCheck=True).match(left_words, right_words)
    pairs = np.array([(*left_points[m.queryIdx].pt, *right_points[m.trainIdx].pt) for m in matches if m.distance < 48])
    if len(pairs) < _LEAST_FEATURES:
        raise NoMotionSeenError(f"{_LEAST_FEATURES} or more features must match between the eyes: got {len(pairs)}")
    shift = left_camera.angles(pairs[:, :2]) - right_camera.angles(pairs[:, 2:])
    level = np.abs(shift[:, 1] - np.median(shift[:, 1])) < math.radians(1.0)
    return float(np.median(shift[level, 0]))


def _grey(image: Image) -> Image:
    return image if image.ndim == 2 else np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY))


def _coarse_shift(first: Image, second: Image) -> tuple[float, float]:
    """Return the shift (x, y) of the whole picture, accurate to a few pixels [px]."""
    size = (first.shape[1] // 4, first.shape[0] // 4)
    small = [cv2.resize(image, size, interpolation=cv2.INTER_AREA).astype(np.float32) for image in (first, second)]
    window = cv2.createHanningWindow(size, cv2.CV_32F)
    (x, y), response = cv2.phaseCorrelate(small[0], small[1], window)
    return (4 * x, 4 * y) if response > 0.05 else (0.0, 0.0)
