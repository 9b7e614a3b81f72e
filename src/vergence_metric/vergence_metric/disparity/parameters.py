"""Parameters of the fovea's disparity estimators, the zero-disparity filter and the class-free tracker.

The names are distinct, so that a node can inherit all the sets into one.
"""

from dataclasses import dataclass

from vergence_metric.disparity.registry import estimator_names
from vergence_rig.parameters import ParameterError, Parameters, parameter

DEPTH_POLICIES = ("center", "nearest", "largest", "box")


@dataclass(frozen=True)
class DisparityParameters(Parameters):
    """How the signed disparity at a point of the left image is found."""

    disparity_estimator: str = parameter("affine", "which estimator answers", choices=estimator_names)
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
            raise ParameterError("disparity_windows_px", windows, "a strictly increasing list of one or more windows")
        box = self.disparity_box_px
        if box and (len(box) != 4 or box[0] >= box[2] or box[1] >= box[3]):
            raise ParameterError("disparity_box_px", box, "empty, or the four numbers x_min, y_min, x_max, y_max in that order")
        if self.disparity_depth_policy == "box" and not box:
            raise ParameterError("disparity_box_px", box, "a box, because disparity_depth_policy is 'box'")


@dataclass(frozen=True)
class TrackerParameters(Parameters):
    """How the class-free tracker locks, follows and gives up."""

    track_saccade_deg: float = parameter(
        2.5,
        "a turn of an eye by more than this within track_saccade_s is a saccade",
        unit="deg",
        minimum=0.5,
        maximum=30.0,
    )
    track_saccade_s: float = parameter(0.07, "see track_saccade_deg", unit="s", minimum=0.02, maximum=1.0)
    track_settle_s: float = parameter(
        0.12, "the joints must have rested this long before the tracker locks", unit="s", minimum=0.0, maximum=2.0
    )
    track_rest_deg_s: float = parameter(
        8.0, "the left eye rests below this speed", unit="deg/s", minimum=0.1, maximum=100.0
    )
    track_still_px: float = parameter(
        1.5, "the fovea's image is still below this motion between frames", unit="px", minimum=0.1, maximum=20.0
    )
    track_still_wait_s: float = parameter(
        0.5, "lock after this rest of the joints even if the image moves", unit="s", minimum=0.0, maximum=5.0
    )
    track_region_px: int = parameter(
        110, "half side of the area in which the target's region is looked for", unit="px", minimum=20, maximum=300
    )
    track_snap_px: float = parameter(
        10.0, "a region this near to the fovea still counts as lying there", unit="px", minimum=0.0, maximum=60.0
    )
    track_disparity_jump_px: float = parameter(
        6.0,
        "a disparity that differs this much from the expected one is another thing's",
        unit="px",
        minimum=1.0,
        maximum=60.0,
    )
    track_minimum_likeness: float = parameter(
        0.55, "correlation with the target's appearance below which it is not seen", minimum=0.1, maximum=0.95
    )
    track_reacquire_likeness: float = parameter(
        0.7, "correlation with its appearance needed to take up a hidden target again", minimum=0.1, maximum=0.99
    )
    track_search_px: int = parameter(
        24,
        "half side of the search about the expected place of a hidden target, at first",
        unit="px",
        minimum=4,
        maximum=200,
    )
    track_search_growth_px_s: float = parameter(
        60.0, "growth of that search with the time hidden", unit="px/s", minimum=0.0, maximum=1000.0
    )
    track_give_up_s: float = parameter(
        3.0, "a target hidden this long is no more searched for", unit="s", minimum=0.1, maximum=60.0
    )
    track_relock_s: float = parameter(
        0.5, "rest of the eyes after a loss until whatever lies at the fovea is taken", unit="s", minimum=0, maximum=60
    )
