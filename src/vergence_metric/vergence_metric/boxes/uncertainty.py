"""How far off a box's sides and centres are: first guesses, to be held against the bench row `box.*`."""

import math

from vergence_metric.boxes.detections import Box

_FLOOR_INPUT_PX = 0.22  # of a centre, in pixels of the network's input
_SHARE = 0.012  # of the box's size
_SURE_SCORE = 0.75


def center_sigma_px(box: Box, source_per_input: float) -> float:
    """Return the standard deviation of one coordinate of a box's centre [px].

    Args:
        box: as detected.
        source_per_input: image pixels per pixel of the network's input.

    """
    size = math.sqrt(max(box.size_px[0] * box.size_px[1], 0.0))
    doubt = max(_SURE_SCORE / max(box.score, 0.05), 1.0)
    return math.hypot(_FLOOR_INPUT_PX * source_per_input, _SHARE * size) * doubt


def disparity_sigma_px(left: Box, right: Box, source_per_input: float) -> float:
    """Return the standard deviation of the disparity of two boxes' centres [px]."""
    return math.hypot(center_sigma_px(left, source_per_input), center_sigma_px(right, source_per_input))
