"""Standard deviations of boxes' centres and of surfaces' disparities.

Fitted by maximum likelihood to the shipped detector's errors on 600 renders of the simulator, world seeds 961000 to
961005 and 963000 to 963003, which no benchmark uses. They do not hold for another detector or a real camera.
"""

import math

from vergence_metric.boxes.detections import Box

_FLOOR_INPUT_PX = 0.165  # of a centre, in pixels of the network's input
_SHARE = 0.0054  # of the box's size
_HIGH_SCORE = 0.9
_MIDDLE_SHARE = 0.03  # of the box's size
_SURFACE_FLOOR_PX = 0.08
_SURFACE_UNSEEN = 0.023  # of the box's size, for the share of it that could not be matched


def center_sigma_px(box: Box, source_per_input: float) -> float:
    """Return the standard deviation of one coordinate of a box's centre [px].

    Args:
        box: as detected.
        source_per_input: image pixels per pixel of the network's input.

    """
    size = math.sqrt(max(box.size_px[0] * box.size_px[1], 0.0))
    inflation = max(_HIGH_SCORE / max(box.score, 0.05), 1.0)
    return math.hypot(_FLOOR_INPUT_PX * source_per_input, _SHARE * size) * inflation


def direction_sigma_px(box: Box, source_per_input: float) -> float:
    """Return the standard deviation of an object's own middle from its box's centre [px], one coordinate."""
    return math.hypot(center_sigma_px(box, source_per_input), _MIDDLE_SHARE * math.sqrt(math.prod(box.size_px)))


def disparity_sigma_px(left: Box, right: Box, source_per_input: float) -> float:
    """Return the standard deviation of the disparity of two boxes' centres [px]."""
    return math.hypot(center_sigma_px(left, source_per_input), center_sigma_px(right, source_per_input))


def surface_sigma_px(box: Box, matched_share: float) -> float:
    """Return the standard deviation of a surface's mean disparity [px] of which a share of the box was matched."""
    size = math.sqrt(max(box.size_px[0] * box.size_px[1], 0.0))
    return math.hypot(_SURFACE_FLOOR_PX, _SURFACE_UNSEEN * (1.0 - matched_share) * size)
