"""Parameters of the edge metric, as the groups `edges.` and `contrast.`."""

from dataclasses import dataclass

from vergence_rig.parameters import ParameterError, Parameters, parameter

MAX_BINS = 8
MAX_TRUNCATION_PX = 15
THRESHOLD_MODES = ("auto", "fixed")


@dataclass(frozen=True)
class EdgeParameters(Parameters):
    """How edges are detected, and in which windows the metric is measured."""

    windows_px: tuple[int, ...] = parameter(
        (50, 100, 150, 200, 250, 300),
        "sides of the square windows about the image centre in which the edge metric is measured",
        unit="px",
        minimum=1,
        maximum=8192,
        formerly="windows_px",
    )
    blur_sigma_px: float = parameter(
        1.4,
        "standard deviation of the Gaussian blur before edge detection; 0 is no blur",
        unit="px",
        minimum=0.0,
        maximum=10.0,
        formerly="blur_sigma_px",
    )
    threshold_mode: str = parameter(
        "auto",
        "thresholds of Canny: `auto` from the image's own gradients, `fixed` as edges.canny_low and edges.canny_high",
        choices=THRESHOLD_MODES,
        formerly="edge_method",
    )
    canny_low: float = parameter(
        20.0,
        "lower gradient threshold of edges.threshold_mode `fixed`",
        unit="grey levels",
        minimum=0.0,
        maximum=4000.0,
        formerly="canny_low",
    )
    canny_high: float = parameter(
        50.0,
        "upper gradient threshold of edges.threshold_mode `fixed`",
        unit="grey levels",
        minimum=0.0,
        maximum=4000.0,
        formerly="canny_high",
    )
    auto_edge_share: float = parameter(
        0.10,
        "edges.threshold_mode `auto`: share of pixels whose gradient exceeds the upper threshold",
        minimum=0.001,
        maximum=0.5,
        formerly="auto_edge_share",
    )
    auto_low_ratio: float = parameter(
        0.4,
        "edges.threshold_mode `auto`: ratio of the lower threshold to the upper one",
        minimum=0.05,
        maximum=1.0,
        formerly="auto_low_ratio",
    )
    auto_floor: float = parameter(
        20.0,
        "edges.threshold_mode `auto`: least upper threshold, so that a blank wall has no edges",
        unit="grey levels",
        minimum=0.0,
        maximum=4000.0,
        formerly="auto_floor",
    )

    def check(self) -> None:
        """Raise ParameterError where two parameters do not fit together."""
        if not self.windows_px:
            raise ParameterError("windows_px", self.windows_px, "a list of one or more windows")
        if len(set(self.windows_px)) != len(self.windows_px):
            raise ParameterError("windows_px", self.windows_px, "a list without repeats")
        if self.canny_low > self.canny_high:
            raise ParameterError("canny_low", self.canny_low, f"at most canny_high ({self.canny_high:g})")


@dataclass(frozen=True)
class ContrastParameters(Parameters):
    """How the contrast with the chance level and the robust form of the metric are computed."""

    orientation_bins: int = parameter(
        8,
        "number of edge directions that contrast and robust metric distinguish",
        minimum=1,
        maximum=MAX_BINS,
        formerly="orientation_bins",
    )
    orientation_signed: bool = parameter(
        True,
        "contrast and robust metric distinguish dark-to-bright from bright-to-dark edges: directions over 360 degrees",
        formerly="orientation_signed",
    )
    truncation_px: int = parameter(
        5,
        "upper bound of each edge distance in the contrast",
        unit="px",
        minimum=2,
        maximum=MAX_TRUNCATION_PX,
        formerly="contrast_truncation_px",
    )
    foveal_sigma_px: float = parameter(
        14.0,
        "standard deviation of the Gaussian weight about the image centre in the foveal contrast",
        unit="px",
        minimum=1.0,
        maximum=1000.0,
        formerly="verged_sigma_px",
    )
    robust_truncation_px: int = parameter(
        5,
        "upper bound of each edge distance in the robust metric",
        unit="px",
        minimum=2,
        maximum=MAX_TRUNCATION_PX,
        formerly="robust_truncation_px",
    )
    robust_sigma_px: float = parameter(
        20.0,
        "standard deviation of the Gaussian weight about the image centre in the robust metric",
        unit="px",
        minimum=1.0,
        formerly="fovea_sigma_px",
    )
