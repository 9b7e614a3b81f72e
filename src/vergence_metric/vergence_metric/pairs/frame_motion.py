"""Motion of a whole image between two frames of one eye: whether the eye is at rest, whatever single objects do."""

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]

_MOST_FEATURES = 60
_FEWEST_FEATURES = 8


def frame_motion_px(before: Image, after: Image) -> float:
    """Return the median motion [px] of features spread over two (h, w) grey images; 0 where there are no features.

    The median follows what fills most of the image. Measured at half resolution: not finer than about 0.2 px.
    """
    first, second = (cv2.resize(image, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA) for image in (before, after))
    corners = cv2.goodFeaturesToTrack(first, _MOST_FEATURES, 0.02, 15)
    if corners is None or len(corners) < _FEWEST_FEATURES:
        return 0.0
    start = np.asarray(corners, np.float32).reshape(-1, 1, 2)
    moved, found, _ = cv2.calcOpticalFlowPyrLK(first, second, start, None, winSize=(15, 15), maxLevel=2)
    flow: NDArray[np.float32] = (moved - start).reshape(-1, 2)[found.ravel() == 1]
    if len(flow) < _FEWEST_FEATURES:
        # All features left the search range: the motion is large.
        return float(max(after.shape))
    return 2.0 * float(np.hypot(*np.median(flow, axis=0)))
