"""When the eyes are called verged."""

from dataclasses import dataclass

from vergence_rig.parameters import ParameterError, parameter
from vergence_rig.verged import VergedLimits


@dataclass(frozen=True)
class VergedParameters(VergedLimits):
    """When the eyes are called verged: the limits of a pair, and how many pairs and which other evidence it takes."""

    contrast: str = parameter(
        "required",
        "role of the edge contrast in `verged`: needed for every pair, needed only while it arrives, or not used",
        choices=("required", "when_seen", "ignored"),
        formerly="contrast",
    )
    direction_rad: float = parameter(
        0.0085,
        "error up to which `verged` may be set: of a gaze direction (the servos' dead band if that is larger), and of "
        "the vergence on a moving target",
        unit="rad",
        minimum=1e-4,
        maximum=0.2,
    )
    enter_pairs: int = parameter(
        2,
        "good pairs in a row after which `verged` is set, unless one pair is certain enough",
        minimum=1,
        maximum=100,
        formerly="verged_pairs",
    )
    single_pair_error_probability: float = parameter(
        0.002,
        "probability of an error above verged.leave_rad up to which a single pair sets `verged`; 0: never",
        minimum=0,
        maximum=1,
        formerly="verged_doubt",
    )
    leave_pairs: int = parameter(
        4, "bad pairs in a row after which `verged` is cleared", minimum=1, maximum=100, formerly="unverged_pairs"
    )
    steady_rad: float = parameter(
        0.005,
        "standard deviation of the estimated vergence below which `verged` may be set",
        unit="rad",
        minimum=1e-4,
        maximum=0.5,
    )
    sweep_rad_s: float = parameter(
        0.6,
        "joint speed, beyond the target's own, above which a pair does not set `verged`: the eyes pass over the target",
        unit="rad/s",
        minimum=0.01,
        maximum=10,
    )
    moving_error_probability: float = parameter(
        0.3,
        "probability of an error above verged.leave_rad by now, up to which eyes on a moving target may be verged",
        minimum=0,
        maximum=1,
    )
    followed_s: float = parameter(
        0.4,
        "time for which every pair must have shown the target on the axes, so that `verged` may be set although its "
        "present position is uncertain",
        unit="s",
        minimum=0,
        maximum=60,
    )
    wrong_share: float = parameter(
        0.05,
        "share of the pairs whose disparity is of another object, as assumed for verged.single_pair_error_probability",
        minimum=0.0001,
        maximum=0.9,
    )
    wrong_range_rad: float = parameter(
        0.5,
        "range over which the disparity of another object may lie, as assumed for verged.single_pair_error_probability",
        unit="rad",
        minimum=0.01,
        maximum=3,
    )
    contrast_age_s: float = parameter(
        0.08,
        "largest difference between the stamps of a pair and of the edge contrast that sets `verged` with it",
        unit="s",
        minimum=0.005,
        maximum=2,
    )
    contrast_lost_s: float = parameter(
        1.0,
        "age of the newest edge contrast above which it counts as missing",
        unit="s",
        minimum=0.05,
        maximum=60,
    )

    def check(self) -> None:
        """Hold the hystereses in order."""
        if self.leave_rad < self.direction_rad:
            raise ParameterError(
                "leave_rad", self.leave_rad, f"at least verged.direction_rad, {self.direction_rad:g} [rad]"
            )
        super().check()
