"""Disparities of a rectified pair by semi-global matching: where nothing was measured, the next best to a truth."""

import cv2
import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Image = npt.NDArray[np.uint8]

_BLOCK_PX = 5
_STEP_PX = 16
_LARGEST_WIDTH_PX = 800
_LARGEST_SHARE = 0.25
_NEIGHBOURHOOD_PX = 9
_LEAST_MATCHED, _LARGEST_SPREAD_PX = 0.8, 2.0
_BEYOND_PX = 1e6


def semi_global(left: Image, right: Image, largest_px: int = 128) -> Array:
    """Return the disparity (h, w) [px] of grey images (h, w) by OpenCV's StereoSGBM in all directions.

    `largest_px`, a multiple of 16, is where the search from 0 on ends. NaN where both ways do not agree to 1 px.
    """
    matcher = cv2.StereoSGBM_create(  # type: ignore[attr-defined]  # missing in OpenCV's own type stubs
        minDisparity=0,
        numDisparities=largest_px,
        blockSize=_BLOCK_PX,
        P1=8 * _BLOCK_PX**2,
        P2=32 * _BLOCK_PX**2,
        disp12MaxDiff=1,
        uniquenessRatio=5,
        speckleWindowSize=50,
        speckleRange=2,
        mode=cv2.STEREO_SGBM_MODE_HH,
    )
    fixed = matcher.compute(left, right)
    return np.where(fixed >= 0, fixed / 16.0, np.nan)


def matched_disparity(left: Image, right: Image) -> Array:
    """Return the disparity (h, w) [px] of photographs (h, w, 3) BGR up to a quarter of their width; NaN if unsure.

    Sure is what is matched both ways, where most within 9x9 px are and differ by 2 px at most: no depth edge is near.
    Pictures more than 800 px wide are matched at that width, and the disparity is as much coarser.
    """
    height, width = left.shape[:2]
    scale = min(1.0, _LARGEST_WIDTH_PX / width)
    size = max(round(scale * width), 1), max(round(scale * height), 1)
    greys = [
        cv2.cvtColor(cv2.resize(image, size, interpolation=cv2.INTER_AREA), cv2.COLOR_BGR2GRAY)
        for image in (left, right)
    ]
    largest = _STEP_PX * max(round(_LARGEST_SHARE * size[0] / _STEP_PX), 1)
    found = semi_global(np.asarray(greys[0], np.uint8), np.asarray(greys[1], np.uint8), largest)
    sure = np.where(_surrounded_alike(found), found, np.nan) * (width / size[0])
    return np.asarray(cv2.resize(sure, (width, height), interpolation=cv2.INTER_NEAREST), np.float64)


def _surrounded_alike(disparity: Array) -> npt.NDArray[np.bool_]:
    """Return where (h, w) a disparity (h, w) is known, and known and alike in the neighbourhood."""
    known = np.isfinite(disparity)
    kernel = np.ones((_NEIGHBOURHOOD_PX, _NEIGHBOURHOOD_PX), np.uint8)
    # What is not known is beyond all that is, so that it is neither the highest nor the lowest near a known one.
    highest = cv2.dilate(np.where(known, disparity, -_BEYOND_PX).astype(np.float32), kernel)
    lowest = cv2.erode(np.where(known, disparity, _BEYOND_PX).astype(np.float32), kernel)
    share = cv2.blur(known.astype(np.float32), (_NEIGHBOURHOOD_PX, _NEIGHBOURHOOD_PX))
    return np.asarray(known & (highest - lowest <= _LARGEST_SPREAD_PX) & (share >= _LEAST_MATCHED))
