"""Parameters of the fovea's disparity estimators, as the group `disparity.`."""

from dataclasses import dataclass

from vergence_metric.disparity.registry import estimator_names
from vergence_rig.parameters import ParameterError, Parameters, parameter

DEPTH_POLICIES = ("center", "nearest", "largest", "box")


@dataclass(frozen=True)
class DisparityParameters(Parameters):
    """How the signed disparity at a point of the left image is found."""

    estimator: str = parameter(
        "semi_global", "name of the disparity estimator", choices=estimator_names, formerly="disparity_estimator"
    )
    depth_policy: str = parameter(
        "center",
        "which surface's disparity is measured where several depths are in view",
        choices=DEPTH_POLICIES,
        formerly="disparity_depth_policy",
    )
    box_px: tuple[float, ...] = parameter(
        (),
        "box of disparity.depth_policy `box` in the left image: x_min, y_min, x_max, y_max",
        unit="px",
        formerly="disparity_box_px",
    )
    max_px: int = parameter(
        160,
        "largest horizontal disparity searched, either sign",
        unit="px",
        minimum=8,
        maximum=600,
        formerly="disparity_max_px",
    )
    max_vertical_px: int = parameter(
        5,
        "largest vertical disparity searched, either sign",
        unit="px",
        minimum=0,
        maximum=40,
        formerly="disparity_max_vertical_px",
    )
    windows_px: tuple[float, ...] = parameter(
        (5.0, 10.0, 20.0),
        "standard deviations of the Gaussian matching windows, ascending: semi_global compares candidates in all, "
        "other estimators use the smallest with an unambiguous match",
        unit="px",
        minimum=2.0,
        maximum=60.0,
        formerly="disparity_windows_px",
    )
    track_px: int = parameter(
        8,
        "reach of the search around an expected disparity, before the whole range is searched",
        unit="px",
        minimum=2,
        maximum=40,
        formerly="disparity_track_px",
    )
    uniqueness: float = parameter(
        0.85,
        "a match is ambiguous if a second correlation peak reaches this share of the best one; without effect on "
        "semi_global",
        minimum=0.5,
        maximum=1.0,
        formerly="disparity_uniqueness",
    )
    left_right_px: float = parameter(
        1.5,
        "left-right consistency: largest distance at which matching back from the right image returns; without effect "
        "on semi_global",
        unit="px",
        minimum=0.5,
        maximum=8.0,
        formerly="disparity_left_right_px",
    )
    min_texture: float = parameter(
        2.0,
        "least standard deviation of a matching window beyond the noise; below it there is no texture to match",
        unit="grey levels",
        minimum=0.1,
        maximum=50.0,
        formerly="disparity_minimum_texture",
    )

    def check(self) -> None:
        """Raise ParameterError where the windows are not in order or the box is none."""
        super().check()
        if not self.windows_px or list(self.windows_px) != sorted(set(self.windows_px)):
            raise ParameterError("windows_px", self.windows_px, "a strictly increasing list of one or more windows")
        box = self.box_px
        if box and (len(box) != 4 or box[0] >= box[2] or box[1] >= box[3]):
            raise ParameterError("box_px", box, "empty, or x_min, y_min, x_max, y_max in that order")
        if self.depth_policy == "box" and not box:
            raise ParameterError("box_px", box, "a box if depth_policy is 'box'")
