"""Where a flow covers or uncovers: a Delaunay mesh on its points that the flow folds, stretches or squeezes.

After Ding, Yan and We (2021, doi 10.3390/ijgi10040234): a triangle that is turned over, or whose area changes by more
than two, does not show one surface before and after, so that its flow is of nothing.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_metric.disparity.protocol import Image
from vergence_metric.tracking.motion.horn_schunck import Flow

_POINTS, _APART_PX, _QUALITY = 300, 6.0, 0.005
_MOST_CHANGE = 2.0


def occluded(image: Image, flow: Flow) -> NDArray[np.bool_]:
    """Return which pixels (h, w) lie in triangles that the flow of an image's corners does not keep."""
    height, width = image.shape
    none = np.zeros((height, width), np.uint8)
    found = cv2.goodFeaturesToTrack(image, _POINTS, _QUALITY, _APART_PX)
    if found is None or len(found) < 3:
        return none.astype(bool)
    points = np.asarray(found, np.float32).reshape(-1, 2)
    mesh = cv2.Subdiv2D((0, 0, width, height))
    mesh.insert(points)
    triangles = np.asarray(mesh.getTriangleList(), np.float32).reshape(-1, 3, 2)
    inside = ((triangles >= 0) & (triangles <= (width - 1, height - 1))).all(axis=(1, 2))
    triangles = triangles[inside]
    x, y = np.rint(triangles[..., 0]).astype(int), np.rint(triangles[..., 1]).astype(int)
    before, after = _areas(triangles), _areas(triangles + flow[y, x])
    with np.errstate(divide="ignore", invalid="ignore"):
        change = after / before
    folded = ~((change >= 1.0 / _MOST_CHANGE) & (change <= _MOST_CHANGE))
    cv2.fillPoly(none, list(np.rint(triangles[folded]).astype(np.int32)), 1)
    return none.astype(bool)


def _areas(triangles: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the signed areas (N,) of triangles (N, 3, 2)."""
    a, b = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    return np.asarray(0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]))
