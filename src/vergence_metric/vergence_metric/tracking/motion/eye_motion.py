"""What the image does because the eye turns: the joint angles' homography, put right by what the image itself shows."""

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_metric.disparity.protocol import Image
from vergence_metric.tracking.eye_view import EyeView

Homography = NDArray[np.float64]

_FEATURES, _APART_PX = 200, 8.0
_AGREE_PX = 0.7
_LEAST_SHARE, _LEAST = 0.5, 20
_MOST_RAD = 0.045  # by which joint angles may be wrong from pair to pair
_ROUNDS = 6


def eye_homography(before: EyeView, now: EyeView, scale: float) -> Homography:
    """Return where a turn of the eye takes each pixel (3, 3), in images reduced by `scale`, whatever the depth."""
    width, height = now.camera.width_px, now.camera.height_px
    corners = np.array([(0.0, 0.0), (width - 1.0, 0.0), (width - 1.0, height - 1.0), (0.0, height - 1.0)])
    taken = now.pixels(before.angles(corners))
    middle = 0.5 * (scale - 1.0)  # pixels are squares about whole coordinates
    source, there = ((points - middle) / scale for points in (corners, taken))
    return np.asarray(cv2.getPerspectiveTransform(source.astype(np.float32), there.astype(np.float32)), np.float64)


def compensated(
    before: Image, now: Image, views: tuple[EyeView, EyeView], scale: float
) -> tuple[Image, NDArray[np.bool_]]:
    """Return the earlier image (h, w) as the eye would see it now, and where it reaches; elsewhere it is the later one.

    The joints of a head are not exact, and a rig may turn as a whole: a rotation that most of the image shares is the
    eye's too.

    Args:
        before: the earlier image, reduced by `scale`.
        now: the present one.
        views: of the eye then and now.
        scale: pixels of the camera per pixel of the images.

    """
    total = eye_homography(*views, scale)
    turned = _warp(before, total)
    rest = _residual(turned, now, views[1], scale)
    if rest is not None:
        total = rest @ total
        turned = _warp(before, total)
    reached = cv2.erode(_warp(np.full(before.shape, 255, np.uint8), total), np.ones((3, 3), np.uint8)) == 255
    return np.where(reached, turned, now), reached


def _warp(image: Image, homography: Homography) -> Image:
    height, width = image.shape
    return np.asarray(cv2.warpPerspective(image, homography, (width, height), flags=cv2.INTER_LINEAR), np.uint8)


def _residual(turned: Image, now: Image, view: EyeView, scale: float) -> Homography | None:
    """Return the homography (3, 3) of the rotation that most corners of the image share, None where they share none."""
    found = cv2.goodFeaturesToTrack(turned, _FEATURES, 0.01, _APART_PX)
    if found is None or len(found) < _LEAST:
        return None
    source = np.asarray(found, np.float32).reshape(-1, 1, 2)
    there, ok, _ = cv2.calcOpticalFlowPyrLK(turned, now, source, None, winSize=(11, 11), maxLevel=2)
    good = ok.ravel() == 1
    if good.sum() < _LEAST:
        return None
    middle = 0.5 * (scale - 1.0)
    first, second = (
        view.camera.pixel_to_ray(points.reshape(-1, 2)[good].astype(np.float64) * scale + middle)
        for points in (source, there)
    )
    first /= np.linalg.norm(first, axis=1)[:, None]
    second /= np.linalg.norm(second, axis=1)[:, None]
    tolerance_rad = _AGREE_PX * scale / view.camera.fx_px
    off = np.linalg.norm(second - first - np.median(second - first, axis=0), axis=1)
    for _ in range(_ROUNDS):
        # Half of the corners may move otherwise: weights of Geman and McClure about what most do.
        spread = max(tolerance_rad, float(np.median(off)))
        weights = (spread**2 / (spread**2 + off**2)) ** 2
        u, _, vt = np.linalg.svd((second * weights[:, None]).T @ first)
        rotation = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
        off = np.linalg.norm(second - first @ rotation.T, axis=1)
    if (off < tolerance_rad).sum() < max(_LEAST, _LEAST_SHARE * len(off)):
        return None
    if np.arccos(np.clip(0.5 * (np.trace(rotation) - 1.0), -1.0, 1.0)) > _MOST_RAD:
        return None
    camera = view.camera
    matrix = np.array(
        [
            [camera.fx_px / scale, 0.0, (camera.cx_px - middle) / scale],
            [0.0, camera.fy_px / scale, (camera.cy_px - middle) / scale],
            [0.0, 0.0, 1.0],
        ]
    )
    return np.asarray(matrix @ rotation @ np.linalg.inv(matrix))
