"""Parameters of the alignment of the right image with the left one, as the group `align.`."""

import math
from dataclasses import dataclass

from vergence_rig.parameters import Parameters, parameter

MODES = ("none", "calibrated", "auto")


@dataclass(frozen=True)
class AlignmentParameters(Parameters):
    """How vertical offset and roll between the eyes are removed from the right image."""

    mode: str = parameter(
        "auto",
        "vertical offset and roll removed from the right image: none, as calibrated, or estimated from the images",
        choices=MODES,
        formerly="align",
    )
    vertical_px: float = parameter(
        0.0,
        "align.mode `calibrated`: vertical offset y_left - y_right at the image centre",
        unit="px",
        minimum=-200.0,
        maximum=200.0,
        formerly="align_vertical_px",
    )
    roll_rad: float = parameter(
        0.0,
        "align.mode `calibrated`: rotation of the right image, clockwise positive",
        unit="rad",
        minimum=-0.35,
        maximum=0.35,
        formerly="align_roll_deg",
    )
    max_vertical_px: float = parameter(
        80.0,
        "align.mode `auto`: largest vertical offset that is removed",
        unit="px",
        minimum=0.0,
        maximum=200.0,
        formerly="align_max_vertical_px",
    )
    max_roll_rad: float = parameter(
        math.radians(6.0),
        "align.mode `auto`: largest rotation that is removed",
        unit="rad",
        minimum=0.0,
        maximum=0.35,
        formerly="align_max_roll_deg",
    )
    search_px: int = parameter(
        200,
        "align.mode `auto`: largest horizontal disparity at which features are matched, either sign",
        unit="px",
        minimum=8,
        maximum=4096,
        formerly="align_search_px",
    )
    every_pairs: int = parameter(
        15,
        "align.mode `auto`: number of pairs from one estimate to the next, after the first five pairs",
        minimum=1,
        maximum=100000,
        formerly="align_every_pairs",
    )
