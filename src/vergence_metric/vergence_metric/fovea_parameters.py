"""Parameters of the fovea's disparity estimators, the zero-disparity filter and the class-free tracker.

The names are distinct, so that a node can inherit all the sets into one.
"""

from dataclasses import dataclass

from vergence_rig.parameters import ParameterError, Parameters, parameter

ESTIMATORS = ("affine", "zncc")
DEPTH_POLICIES = ("center", "nearest", "largest", "box")


@dataclass(frozen=True)
class DisparityParameters(Parameters):
    """How the signed disparity at a point of the left image is found."""

    disparity_estimator: str = parameter("affine", "which estimator answers", choices=ESTIMATORS)
    disparity_depth_policy: str = parameter(
        "center", "whose disparity counts where several depths are in view", choices=DEPTH_POLICIES
    )
    disparity_box_px: tuple[float, ...] = parameter(
        (), "for the policy box: x_min, y_min, x_max, y_max in the left image", unit="px"
    )
    disparity_max_px: int = parameter(
        160, "disparities are searched to this on both sides", unit="px", minimum=8, maximum=600
    )
    disparity_max_vertical_px: int = parameter(
        5, "vertical disparities are searched to this on both sides", unit="px", minimum=0, maximum=40
    )
    disparity_windows_px: tuple[float, ...] = parameter(
        (5.0, 10.0, 20.0),
        "standard deviations of the Gaussian windows, small to large: the smallest that is sure answers",
        unit="px",
        minimum=2.0,
        maximum=60.0,
    )
    disparity_track_px: int = parameter(
        8, "searched to this around an expected disparity before searching wide", unit="px", minimum=2, maximum=40
    )
    disparity_uniqueness: float = parameter(
        0.85,
        "a second correlation peak at this share of the best or above makes it ambiguous",
        minimum=0.5,
        maximum=1.0,
    )
    disparity_left_right_px: float = parameter(
        1.5, "matching back from the right image must return to within this", unit="px", minimum=0.5, maximum=8.0
    )
    disparity_minimum_texture: float = parameter(
        2.0, "standard deviation that the window needs beyond the noise", unit="grey levels", minimum=0.1, maximum=50.0
    )

    def check(self) -> None:
        """Raise ParameterError where the windows are not in order or the box is none."""
        super().check()
        windows = self.disparity_windows_px
        if not windows or list(windows) != sorted(set(windows)):
            raise ParameterError("disparity_windows_px", windows, "at least one, strictly increasing")
        box = self.disparity_box_px
        if box and (len(box) != 4 or box[0] >= box[2] or box[1] >= box[3]):
            raise ParameterError("disparity_box_px", box, "empty, or x_min, y_min, x_max, y_max in that order")
        if self.disparity_depth_policy == "box" and not box:
            raise ParameterError("disparity_box_px", box, "a box, because disparity_depth_policy is 'box'")
