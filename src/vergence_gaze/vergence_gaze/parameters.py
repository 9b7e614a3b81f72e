"""The gaze controller's parameters, in groups; each control law describes its own beside itself.

Default angles have 17 digits so that the YAML equals them exactly.
"""

from dataclasses import dataclass
from typing import TypeVar

from vergence_gaze.law_registry import law_names
from vergence_rig.parameters import ParameterError, Parameters, parameter

MODES = ("both_eyes", "left_held", "right_held")

Group = TypeVar("Group", bound=Parameters)


@dataclass(frozen=True)
class ControlParameters(Parameters):
    """What the controller does, whatever the target."""

    law: str = parameter("predictive", "control law that turns the eyes", choices=law_names)
    mode: str = parameter("both_eyes", "which eyes may turn: a held eye keeps its pan angle", choices=MODES)
    tilt_enabled: bool = parameter(True, "whether the controller may turn the tilt joint")
    start: str = parameter(
        "idle",
        "behaviour before the first goal: hold still, or verge on what the left eye sees",
        choices=("idle", "verge"),
    )
    time_limit_s: float = parameter(
        5.0, "time limit of a goal that states none; the goal then fails", unit="s", minimum=0.1, maximum=600
    )
    no_images_s: float = parameter(
        2.0,
        "time without any result from the images after which a goal fails with NO_IMAGES",
        unit="s",
        minimum=0.1,
        maximum=600,
    )


@dataclass(frozen=True)
class GazeNodeParameters(ControlParameters):
    """The same, and the node's own."""

    rig: str = parameter("", "path of rig.yaml; empty for the built-in rig", read_only=True)
    control_rate_hz: float = parameter(
        50.0, "rate of the control cycle", unit="Hz", minimum=5, maximum=1000, read_only=True
    )


@dataclass(frozen=True)
class SaccadeParameters(Parameters):
    """When the eyes jump."""

    threshold_rad: float = parameter(
        0.05,
        "gaze error above which the eyes make a saccade: full speed, images ignored until the eyes are still",
        unit="rad",
        minimum=0.005,
        maximum=1,
        formerly="saccade_threshold_rad",
    )


@dataclass(frozen=True)
class ExposureParameters(Parameters):
    """Which images count while the eyes turn."""

    still_speed_rad_s: float = parameter(
        0.6,
        "joint speed above which images are not used, unless the eyes follow a moving target",
        unit="rad/s",
        minimum=0.01,
        maximum=10,
        formerly="still_speed_rad_s",
    )
    settle_s: float = parameter(
        0.02,
        "time before an exposure during which the eyes must have been still for the image to be used",
        unit="s",
        minimum=0,
        maximum=0.5,
        formerly="settle_s",
    )


@dataclass(frozen=True)
class ServoParameters(Parameters):
    """How commands compensate the servos' dead band and backlash."""

    hold_tolerance_rad: float = parameter(
        0.0004,
        "joint error that is not corrected, in addition to a share of the servo's dead band",
        unit="rad",
        minimum=0,
        maximum=0.1,
        formerly="hold_tolerance_rad",
    )
    play_compensation: float = parameter(
        0.85,
        "share of the described dead band and backlash that is compensated at once when a joint reverses; less than 1, "
        "so that a servo with less play than described does not oscillate",
        minimum=0,
        maximum=1,
        formerly="dead_band_trust",
    )
    play_learning: float = parameter(
        0.7,
        "share of a difference between the described and the observed play of a joint that is learnt at its next "
        "reversal; 0 keeps the description",
        minimum=0,
        maximum=1,
    )


@dataclass(frozen=True)
class TargetParameters(Parameters):
    """How the target is estimated."""

    calm_acceleration_rad_s2: float = parameter(
        1.0,
        "acceleration of a calmly moving target (process noise of the calm motion model)",
        unit="rad/s^2",
        minimum=0.01,
        maximum=100,
        formerly="follow_acceleration_rad_s2",
    )
    manoeuvre_acceleration_rad_s2: float = parameter(
        8.0,
        "acceleration of a manoeuvring target (process noise of the manoeuvring motion model)",
        unit="rad/s^2",
        minimum=0.01,
        maximum=1000,
        formerly="manoeuvre_acceleration_rad_s2",
    )
    rest_drift_rad_sqrt_s: float = parameter(
        0.002,
        "random walk of a target at rest (process noise of the model at rest)",
        unit="rad/sqrt(s)",
        minimum=0,
        maximum=1,
        formerly="still_drift_rad_sqrt_s",
    )
    gate_sigma: float = parameter(
        4.5,
        "measurements whose innovation exceeds this many standard deviations are outliers",
        minimum=1,
        maximum=20,
        formerly="gate_sigma",
    )
    jump_count: int = parameter(
        2,
        "mutually consistent outliers in a row after which the target is taken to have jumped there",
        minimum=1,
        maximum=20,
        formerly="jump_count",
    )
    distractor_persistence_s: float = parameter(
        1.0,
        "time that boxes elsewhere must persist before the eyes follow them while the fovea still shows the target",
        unit="s",
        minimum=0,
        maximum=60,
        formerly="distractor_patience_s",
    )
    prior_vergence_rad: float = parameter(
        0.065,
        "vergence assumed for a target of unknown distance",
        unit="rad",
        minimum=0,
        maximum=1,
        formerly="prior_vergence_rad",
    )
    prior_vergence_sigma_rad: float = parameter(
        0.08,
        "standard deviation of target.prior_vergence_rad",
        unit="rad",
        minimum=0.001,
        maximum=1,
        formerly="prior_vergence_sigma_rad",
    )
    fovea_radius_rad: float = parameter(
        0.03,
        "distance of the target from the fovea up to which the disparity at the fovea counts as the target's",
        unit="rad",
        minimum=0.001,
        maximum=0.5,
        formerly="fovea_radius_rad",
    )
    track_radius_rad: float = parameter(
        0.07,
        "distance from the requested target up to which a new track is accepted as the target",
        unit="rad",
        minimum=0.001,
        maximum=1,
        formerly="adopt_radius_rad",
    )
    minimum_confidence: float = parameter(
        0.3,
        "disparities at the fovea with less confidence than this are not used",
        minimum=0,
        maximum=1,
        formerly="minimum_confidence",
    )
    direction_sigma_rad: float = parameter(
        0.0006,
        "standard deviation of a direction measured in one eye",
        unit="rad",
        minimum=1e-5,
        maximum=0.1,
        formerly="direction_sigma_rad",
    )
    point_sigma_rad: float = parameter(
        0.002,
        "standard deviation of the direction of a point given by gaze/target",
        unit="rad",
        minimum=1e-5,
        maximum=0.2,
        formerly="point_sigma_rad",
    )
    point_tolerance_rad: float = parameter(
        0.0175,
        "difference in direction or vergence up to which what is seen lies at a point that was requested in space",
        unit="rad",
        minimum=0.001,
        maximum=0.5,
    )
    point_dwell_s: float = parameter(
        0.6,
        "time at rest on a point requested in space after which it is empty if nothing was seen there",
        unit="s",
        minimum=0.1,
        maximum=60,
    )
    disagreement_rad: float = parameter(
        0.02,
        "difference of two estimators' vergence, beyond the object's own depth, above which the eyes hold still",
        unit="rad",
        minimum=0.001,
        maximum=1,
        formerly="disagreement_rad",
    )
    lost_after_s: float = parameter(
        0.35,
        "time without a measurement of the target after which it is lost",
        unit="s",
        minimum=0.05,
        maximum=60,
        formerly="lost_after_s",
    )


@dataclass(frozen=True)
class VergedParameters(Parameters):
    """When the eyes are called verged."""

    contrast: str = parameter(
        "required",
        "role of the edge contrast in `verged`: needed for every pair, needed only while it arrives, or not used",
        choices=("required", "when_seen", "ignored"),
        formerly="contrast",
    )
    contrast_enter: float = parameter(
        0.78,
        "edge contrast up to which `verged` may be set",
        minimum=0,
        maximum=2,
        formerly="contrast_enter",
    )
    contrast_leave: float = parameter(
        0.9,
        "edge contrast above which a pair counts against `verged` while it is set",
        minimum=0,
        maximum=2,
        formerly="contrast_leave",
    )
    enter_rad: float = parameter(
        0.0045,
        "vergence error up to which `verged` may be set on a target at rest",
        unit="rad",
        minimum=1e-4,
        maximum=0.2,
        formerly="verged_enter_rad",
    )
    direction_rad: float = parameter(
        0.0085,
        "error up to which `verged` may be set: of a gaze direction (the servos' dead band if that is larger), and of "
        "the vergence on a moving target",
        unit="rad",
        minimum=1e-4,
        maximum=0.2,
    )
    leave_rad: float = parameter(
        0.0155,
        "vergence or direction error above which a pair counts against `verged` while it is set",
        unit="rad",
        minimum=1e-4,
        maximum=0.2,
        formerly="verged_leave_rad",
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

    def check(self) -> None:
        """Hold the hystereses in order."""
        if self.contrast_leave < self.contrast_enter:
            raise ParameterError(
                "contrast_leave", self.contrast_leave, f"at least verged.contrast_enter, {self.contrast_enter:g}"
            )
        if self.leave_rad < self.direction_rad:
            raise ParameterError(
                "leave_rad", self.leave_rad, f"at least verged.direction_rad, {self.direction_rad:g} [rad]"
            )
        if self.leave_rad < self.enter_rad:
            raise ParameterError("leave_rad", self.leave_rad, f"at least verged.enter_rad, {self.enter_rad:g} [rad]")


@dataclass(frozen=True)
class SearchParameters(Parameters):
    """How a lost target is searched for."""

    after_s: float = parameter(
        1.0,
        "time after the target was lost until the eyes start to search",
        unit="s",
        minimum=0,
        maximum=600,
        formerly="search_after_s",
    )
    dwell_s: float = parameter(
        0.3,
        "time for which the eyes rest at each place of the search",
        unit="s",
        minimum=0.02,
        maximum=10,
        formerly="search_dwell_s",
    )


@dataclass(frozen=True)
class GazeParameters:
    """All groups of the controller; `parameter_groups.gaze_parameters` builds them from full names."""

    control: ControlParameters
    saccade: SaccadeParameters
    exposure: ExposureParameters
    servo: ServoParameters
    target: TargetParameters
    verged: VergedParameters
    search: SearchParameters
    laws: tuple[Parameters, ...]

    def of_law(self, kind: type[Group]) -> Group:
        """Return a law's own parameters, which are of class `kind`."""
        return next(group for group in self.laws if type(group) is kind)
