"""Parameters of the edge metric; the node composes them with those of its pairer and its disparity estimator."""

from dataclasses import dataclass

from vergence_rig.parameters import ParameterError, Parameters, parameter

MOST_BINS = 8
LARGEST_TRUNCATION_PX = 15
EDGE_METHODS = ("auto", "fixed")
ALIGN_MODES = ("none", "calibrated", "auto")


@dataclass(frozen=True)
class EdgeMetricParameters(Parameters):
    """What the edge metric can be told; defaults equal config/edge_metric_node.yaml."""

    windows_px: tuple[int, ...] = parameter(
        (50, 100, 150, 200, 250, 300), "sides of the centre windows", unit="px", minimum=1, maximum=8192
    )
    blur_sigma_px: float = parameter(
        1.4, "Gaussian blur before the edge detector; 0 is none", unit="px", minimum=0.0, maximum=10.0
    )
    edge_method: str = parameter(
        "auto", "where Canny's thresholds come from: the image's own gradients, or as given", choices=EDGE_METHODS
    )
    canny_low: float = parameter(
        20.0, "lower gradient threshold of edge_method fixed", unit="grey levels", minimum=0.0, maximum=4000.0
    )
    canny_high: float = parameter(
        50.0, "upper gradient threshold of edge_method fixed", unit="grey levels", minimum=0.0, maximum=4000.0
    )
    auto_edge_share: float = parameter(
        0.10, "edge_method auto: share of pixels whose gradient passes the upper threshold", minimum=0.001, maximum=0.5
    )
    auto_low_ratio: float = parameter(
        0.4, "edge_method auto: lower threshold over the upper one", minimum=0.05, maximum=1.0
    )
    auto_floor: float = parameter(
        20.0,
        "edge_method auto: the upper threshold never falls below this, so that a blank wall has no edges",
        unit="grey levels",
        minimum=0.0,
        maximum=4000.0,
    )
    orientation_bins: int = parameter(
        8, "contrast and robust form: edge directions that are told apart", minimum=1, maximum=MOST_BINS
    )
    orientation_signed: bool = parameter(
        True, "contrast and robust form: tell dark-to-bright from bright-to-dark edges (directions over 360 degrees)"
    )
    contrast_truncation_px: int = parameter(
        5, "contrast: no distance counts for more", unit="px", minimum=2, maximum=LARGEST_TRUNCATION_PX
    )
    robust_truncation_px: int = parameter(
        5, "robust form: no distance counts for more", unit="px", minimum=2, maximum=LARGEST_TRUNCATION_PX
    )
    fovea_sigma_px: float = parameter(
        20.0, "robust form: Gaussian weight of edge pixels around the image centre", unit="px", minimum=1.0
    )
    align: str = parameter(
        "auto", "how vertical offset and roll between the eyes are taken out of the right image", choices=ALIGN_MODES
    )
    align_vertical_px: float = parameter(
        0.0, "align calibrated: y_left - y_right at the image centre", unit="px", minimum=-200.0, maximum=200.0
    )
    align_roll_deg: float = parameter(
        0.0, "align calibrated: the right image's rotation, clockwise positive", unit="deg", minimum=-20.0, maximum=20.0
    )
    align_max_vertical_px: float = parameter(
        24.0, "align auto: no larger offset is taken out", unit="px", minimum=0.0, maximum=200.0
    )
    align_max_roll_deg: float = parameter(
        4.0, "align auto: no larger rotation is taken out", unit="deg", minimum=0.0, maximum=20.0
    )
    align_search_px: int = parameter(
        200, "align auto: horizontal disparities are searched to this on both sides", unit="px", minimum=8, maximum=4096
    )
    align_every_pairs: int = parameter(
        15, "align auto: after the first few pairs, estimate on one pair in so many", minimum=1, maximum=100000
    )
    verged_sigma_px: float = parameter(
        14.0,
        "verged: Gaussian weight of edge pixels around the image centre in the contrast that judges",
        unit="px",
        minimum=1.0,
        maximum=1000.0,
    )
    verged_contrast: float = parameter(0.6, "verged: at most this contrast of the fovea", minimum=0.0, maximum=2.0)
    verged_leave_contrast: float = parameter(0.72, "verged: above this contrast it ends", minimum=0.0, maximum=2.0)
    verged_px: float = parameter(2.0, "verged: at most this signed error", unit="px", minimum=0.0, maximum=1000.0)
    verged_leave_px: float = parameter(
        4.0, "verged: above this signed error it ends", unit="px", minimum=0.0, maximum=1000.0
    )
    verged_confidence: float = parameter(
        0.5, "verged: signed errors of less confidence are taken for unknown", minimum=0.0, maximum=1.0
    )

    def check(self) -> None:
        """Raise ParameterError where two parameters do not fit together."""
        if not self.windows_px:
            raise ParameterError("windows_px", self.windows_px, "at least one window")
        if len(set(self.windows_px)) != len(self.windows_px):
            raise ParameterError("windows_px", self.windows_px, "windows that differ from one another")
        if self.canny_low > self.canny_high:
            raise ParameterError("canny_low", self.canny_low, f"at most canny_high ({self.canny_high:g})")
        for enter, leave in (("verged_contrast", "verged_leave_contrast"), ("verged_px", "verged_leave_px")):
            if getattr(self, leave) < getattr(self, enter):
                raise ParameterError(leave, getattr(self, leave), f"at least {enter} ({getattr(self, enter):g})")
