"""How far a whole image has moved since the one before: tells whether an eye rests, whatever single things do."""

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_metric.disparity.protocol import Image

_MOST_FEATURES = 60
_FEWEST_FEATURES = 8


def image_motion_px(before: Image, after: Image) -> float:
    """Return the median motion [px] of features spread over the image; 0 where there is nothing to follow.

    The median follows what fills most of the image; measured at half resolution, so not finer than about 0.2 px.
    """
    first, second = (cv2.resize(image, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA) for image in (before, after))
    corners = cv2.goodFeaturesToTrack(first, _MOST_FEATURES, 0.02, 15)
    if corners is None or len(corners) < _FEWEST_FEATURES:
        return 0.0
    start = np.asarray(corners, np.float32).reshape(-1, 1, 2)
    moved, found, _ = cv2.calcOpticalFlowPyrLK(first, second, start, None, winSize=(15, 15), maxLevel=2)
    flow: NDArray[np.float32] = (moved - start).reshape(-1, 2)[found.ravel() == 1]
    if len(flow) < _FEWEST_FEATURES:
        # Everything left the place where it was looked for: that is motion, and a lot of it.
        return float(max(after.shape))
    return 2.0 * float(np.hypot(*np.median(flow, axis=0)))
