"""What moves in an eye's image although the eye turns too, as a mask.

After Ding, Yan and We (2021, doi 10.3390/ijgi10040234): dense flow, less where a mesh on it shows occlusion; its
magnitude parted by Otsu's threshold, but not below a noise floor, so that nothing is found where nothing moves; the
largest component, or that nearest to where the target is predicted. Their rig is fixed; here the earlier image is
turned as the eye has turned before. Where boxes suffice and the eyes rest, `boxes/motion.py` costs a fortieth.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_metric.disparity.protocol import Image
from vergence_metric.tracking.eye_view import EyeView, Pixel
from vergence_metric.tracking.motion.eye_motion import compensated
from vergence_metric.tracking.motion.horn_schunck import Flow, horn_schunck, warped
from vergence_metric.tracking.motion.occlusion_mesh import occluded
from vergence_metric.tracking.zero_disparity import filled

Mask = NDArray[np.bool_]
FlowOf = Callable[[Image, Image], Flow]

WIDTH_PX = 320
"""Width to which images are reduced."""
_FLOOR_PX = 0.5  # of flow from pair to pair, at this width
_FLOOR_MEDIANS = 4.0
_CLOSING_PX, _OPENING_PX = 9, 5
_LEAST_AREA_PX, _MOST_SHARE = 200, 0.4
_COMPARED_PX, _NOISE = 3, 0.5  # window over which images are compared; grey levels
_LATEST_S = 0.25  # pairs farther apart show no flow


@dataclass(frozen=True)
class MovingRegion:
    """What moves: `mask` (h, w) of the left image reduced by `scale`; centre and extent [px] in the full image.

    `speed_px` is its median flow since the last pair, in pixels of the full image.
    """

    mask: Mask
    scale: float
    center_px: Pixel
    extent_px: tuple[float, float]
    speed_px: float


class MotionDetector:
    """Finds what moves between successive images of one eye.

    Args:
        flow_of: dense flow of two grey images (h, w), as (h, w, 2).
    """

    def __init__(self, flow_of: FlowOf = horn_schunck) -> None:
        self._flow_of = flow_of
        self._before: tuple[float, Image, EyeView] | None = None

    def update(
        self, image: Image, view: EyeView, stamp_s: float, expected_px: Pixel | None = None, reach_px: float = math.inf
    ) -> MovingRegion | str:
        """Return what moves in the next image (h, w), or why nothing is found.

        Args:
            image: of the eye, grey.
            view: of the eye at its exposure.
            stamp_s: of the image.
            expected_px: where the target is predicted; None for the largest of what moves.
            reach_px: largest distance from there to the region's centre.

        """
        scale = max(image.shape[1] / WIDTH_PX, 1.0)
        size = (round(image.shape[1] / scale), round(image.shape[0] / scale))
        small = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA) if scale > 1.0 else image)
        before, self._before = self._before, (stamp_s, small, view)
        if before is None or before[1].shape != small.shape or not 0.0 < stamp_s - before[0] <= _LATEST_S:
            return "motion needs two images in succession"
        turned, reached = compensated(before[1], small, (before[2], view), scale)
        # From the present to the past: the mask is of what is seen now.
        flow = self._flow_of(small, turned)
        magnitude = np.hypot(flow[..., 0], flow[..., 1])
        hidden = ~reached | occluded(small, flow)
        magnitude[cv2.dilate((~reached).astype(np.uint8), np.ones((9, 9), np.uint8)) > 0] = 0.0
        magnitude[_at_rest(small, turned, flow)] = 0.0
        moving = self._moving(magnitude, hidden)
        if isinstance(moving, str):
            return moving
        return _component(moving, magnitude, scale, expected_px, reach_px)

    def _moving(self, magnitude: NDArray[np.float32], hidden: Mask) -> Mask | str:
        """Return which pixels move."""
        counted = magnitude[~hidden]
        if not counted.size:
            return "nothing of the last image is in view"
        floor_px = max(_FLOOR_PX, _FLOOR_MEDIANS * float(np.median(counted)))
        top_px = float(np.quantile(counted, 0.999))
        if top_px <= floor_px:
            return f"nothing moves: by {top_px:.1f} px at most, noise is {floor_px:.1f} px"
        levels = np.clip(counted * (255.0 / top_px), 0, 255).astype(np.uint8)
        level, _ = cv2.threshold(levels.reshape(1, -1), 0, 255, cv2.THRESH_BINARY + cv2.THRESH_OTSU)
        moving = (magnitude > max(floor_px, level * top_px / 255.0)) & ~hidden
        return np.asarray(moving)


def _at_rest(now: Image, turned: Image, flow: Flow) -> Mask:
    """Return which pixels (h, w) the flow does not explain better than rest does.

    Smooth flow goes on beyond what moves, where each pixel looks as if it had not moved. And what has been uncovered
    may look like what the flow brings there: but that has not left the place it would have come from.
    """
    rest, moved = (_difference(now, other) for other in (turned, warped(turned, flow)))
    left_behind = warped(rest, flow)
    uncovered = (left_behind + _NOISE < rest) & (left_behind < moved + _NOISE)
    return np.asarray((moved >= rest) | uncovered)


def _difference(one: Image, other: Image) -> NDArray[np.float32]:
    return np.asarray(cv2.boxFilter(cv2.absdiff(one, other), cv2.CV_32F, (_COMPARED_PX, _COMPARED_PX)))


def _component(
    moving: Mask, magnitude: NDArray[np.float32], scale: float, expected_px: Pixel | None, reach_px: float
) -> MovingRegion | str:
    """Return the region that is the target."""
    disc = [cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size)) for size in (_OPENING_PX, _CLOSING_PX)]
    opened = cv2.morphologyEx(moving.astype(np.uint8), cv2.MORPH_OPEN, disc[0])
    closed = cv2.morphologyEx(opened, cv2.MORPH_CLOSE, disc[1])
    count, labels, stats, centers = cv2.connectedComponentsWithStats(closed)
    areas = stats[:, cv2.CC_STAT_AREA].astype(float)
    areas[0] = 0.0
    fit = areas >= _LEAST_AREA_PX
    if count < 2 or not fit.any():
        return "nothing that moves is large enough"
    if areas.max() > _MOST_SHARE * moving.size:
        return "most of the view moves"
    middle = 0.5 * (scale - 1.0)
    centers = centers * scale + middle
    if expected_px is None:
        chosen = int(areas.argmax())
    else:
        away = np.where(fit, np.hypot(*(centers - expected_px).T), math.inf)
        chosen = int(away.argmin())
        if away[chosen] > reach_px:
            return f"nothing moves where it is expected: the nearest is {away[chosen]:.0f} px away"
    mask = filled(labels == chosen)
    ys, xs = np.nonzero(mask)
    extent = tuple(scale * math.sqrt(12.0 * float(c.var()) + 1.0) for c in (xs, ys))
    return MovingRegion(
        mask,
        scale,
        (float(xs.mean()) * scale + middle, float(ys.mean()) * scale + middle),
        (extent[0], extent[1]),
        scale * float(np.median(magnitude[mask])),
    )
