"""Corners of an image to a fraction of a pixel, and what they look like."""

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_metric.disparity.fovea_pair import cut
from vergence_metric.disparity.protocol import Image
from vergence_metric.tracking.eye_view import Pixel

Points = NDArray[np.float64]
Patches = NDArray[np.float32]

_SIDE_PX = 9
_QUALITY = 0.01  # of the strongest corner in a target's own window: least strength of its corners
_LEAST_QUALITY = 0.002  # of the strongest corner in any window
_BLOCK_PX = 3
_LEAST_CONTRAST = 3.0  # grey levels, standard deviation
_AREA = _SIDE_PX * _SIDE_PX
_ACROSS = np.arange(_SIDE_PX, dtype=np.float32) - (_SIDE_PX - 1) / 2


def find_corners(
    image: Image, center_px: Pixel, half_px: int, most: int, apart_px: float, strongest: float = 0.0
) -> Points:
    """Return up to `most` corners (N, 2) [px] of an image (h, w) in the square about a point, `apart_px` apart.

    Where a target has been learnt, `strongest` is the strength of its strongest corner: its others are found beside
    stronger ones of what it passes.
    """
    x0, y0 = round(center_px[0]) - half_px, round(center_px[1]) - half_px
    area = cut(image, x0, y0, 2 * half_px + 1, 2 * half_px + 1)
    quality = _QUALITY
    if strongest > 0.0:
        here = max(_strength(area), strongest)
        quality = max(_QUALITY * strongest / here, _LEAST_QUALITY)
    found = cv2.goodFeaturesToTrack(area, most, quality, apart_px, blockSize=_BLOCK_PX)
    if found is None:
        return np.empty((0, 2))
    corners = np.ascontiguousarray(np.asarray(found, np.float32).reshape(-1, 1, 2))
    refined = cv2.cornerSubPix(area, corners.copy(), (3, 3), (-1, -1), (cv2.TERM_CRITERIA_EPS + 1, 10, 0.03))
    moved = np.abs(refined - corners).max(axis=2) > 1.5  # it has left for another corner
    refined[moved] = corners[moved]
    return np.asarray(refined.reshape(-1, 2).astype(np.float64) + np.array([x0, y0]))


def strongest_corner(image: Image, center_px: Pixel, half_px: int) -> float:
    """Return the strength of the strongest corner of an image in the square about a point."""
    side = 2 * half_px + 1
    area = cut(image, round(center_px[0]) - half_px, round(center_px[1]) - half_px, side, side)
    return _strength(area)


def _strength(area: Image) -> float:
    return float(cv2.cornerMinEigenVal(area, _BLOCK_PX).max())


def patches_at(image: Image, points: Points) -> Patches:
    """Return the 9 by 9 px about points (N, 2), without mean and of unit length (N, 81); 0 without texture."""
    if not len(points):
        return np.empty((0, _AREA), np.float32)
    x = (points[:, 0, None, None] + _ACROSS[None, None, :]).astype(np.float32)
    y = (points[:, 1, None, None] + _ACROSS[None, :, None]).astype(np.float32)
    shape = (len(points), _SIDE_PX, _SIDE_PX)
    across, down = (np.ascontiguousarray(np.broadcast_to(one, shape).reshape(-1, _SIDE_PX)) for one in (x, y))
    seen = cv2.remap(image, across, down, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT)
    flat = seen.reshape(len(points), _AREA).astype(np.float32)
    flat -= flat.mean(axis=1)[:, None]
    length = np.linalg.norm(flat, axis=1)
    flat /= np.maximum(length, 1e-6)[:, None]
    flat[length < _LEAST_CONTRAST * np.sqrt(_AREA)] = 0.0
    return np.asarray(flat, np.float32)


def match_right(
    left: Image,
    right: Image,
    points: Points,
    expected: Points,
    least_correlation: float,
    patches: Patches | None = None,
) -> tuple[Points, NDArray[np.bool_]]:
    """Return where corners (N, 2) of the left image are in the right one, and which were found (N,).

    `patches` are those of the left image at the corners (`patches_at`), where they are known already.
    Lucas and Kanade's flow from the `expected` places (N, 2); it must return, and what is there must look alike.
    """
    if not len(points):
        return np.empty((0, 2)), np.empty(0, bool)
    margin = 24
    crops, starts = [], []
    for image, places in ((left, points), (right, expected)):
        low = np.floor(places.min(axis=0)).astype(int) - margin
        size = np.ceil(np.maximum(np.ptp(points, axis=0), np.ptp(expected, axis=0))).astype(int) + 2 * margin
        crops.append(cut(image, int(low[0]), int(low[1]), int(size[0]), int(size[1])))
        starts.append(low)
    source = (points - starts[0]).astype(np.float32).reshape(-1, 1, 2)
    guess = (expected - starts[1]).astype(np.float32).reshape(-1, 1, 2)
    there, found, _ = cv2.calcOpticalFlowPyrLK(
        crops[0],
        crops[1],
        source,
        guess.copy(),
        winSize=(11, 11),
        maxLevel=1,
        criteria=(cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 12, 0.02),
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
    )
    places = there.reshape(-1, 2).astype(np.float64) + starts[1]
    there_patches, here_patches = patches_at(right, places), patches_at(left, points) if patches is None else patches
    alike = np.einsum("ij,ij->i", here_patches, there_patches)
    return places, (found.ravel() == 1) & (alike >= least_correlation)
