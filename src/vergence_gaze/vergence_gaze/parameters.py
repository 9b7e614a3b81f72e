"""The gaze controller's parameters."""

import math
from dataclasses import dataclass

from vergence_rig.parameters import Groups, ParameterError, Parameters, parameter

_DEG = math.pi / 180.0

LAWS = ("predictive", "pd_bangbang", "pid_pursuit", "metric_descent")
MODES = ("both_eyes", "left_held", "right_held")


@dataclass(frozen=True)
class GazeParameters(Parameters):
    """What can be set about the control of gaze. Defaults equal config/gaze_controller_node.yaml."""

    law: str = parameter("predictive", "control law", choices=LAWS)
    mode: str = parameter("both_eyes", "which eyes move; a held eye keeps its pan", choices=MODES)
    tilt_enabled: bool = parameter(True, "whether the tilt bar moves")
    start: str = parameter(
        "idle", "what to do without a goal: hold still, or verge on what is seen", choices=("idle", "verge")
    )
    time_limit_s: float = parameter(5.0, "time limit of a goal that gives none", unit="s", minimum=0.1, maximum=600)

    # Default angles are 17 digits so that the YAML equals them exactly.
    saccade_threshold_rad: float = parameter(
        0.05,
        "error from which the eyes jump and vision is ignored until they are still",
        unit="rad",
        minimum=0.005,
        maximum=1,
    )
    still_speed_rad_s: float = parameter(
        0.6, "eye speed above which images are not used", unit="rad/s", minimum=0.01, maximum=10
    )
    settle_s: float = parameter(0.02, "rest before an exposure, for it to be used", unit="s", minimum=0, maximum=0.5)
    hold_tolerance_rad: float = parameter(
        0.0004, "error that a joint leaves alone, beside its share of the dead band", unit="rad", minimum=0, maximum=0.1
    )
    dead_band_trust: float = parameter(
        0.85, "share of the known play that is crossed at once when a joint turns round", minimum=0, maximum=1
    )
    follow_acceleration_rad_s2: float = parameter(
        1.0, "how fast a calmly moving target changes its speed", unit="rad/s^2", minimum=0.01, maximum=100
    )
    manoeuvre_acceleration_rad_s2: float = parameter(
        8.0, "how fast it does while it manoeuvres", unit="rad/s^2", minimum=0.01, maximum=1000
    )
    still_drift_rad_sqrt_s: float = parameter(
        0.002, "random walk of a target at rest", unit="rad/sqrt(s)", minimum=0, maximum=1
    )
    gate_sigma: float = parameter(4.5, "innovations beyond this many deviations are outliers", minimum=1, maximum=20)
    jump_count: int = parameter(
        2, "outliers that agree with one another before the target has jumped", minimum=1, maximum=20
    )
    distractor_patience_s: float = parameter(
        1.0,
        "how long boxes elsewhere are not believed while the fovea still sees the target's depth",
        unit="s",
        minimum=0,
        maximum=60,
    )
    prior_vergence_rad: float = parameter(
        0.065, "vergence assumed for a target of unknown distance", unit="rad", minimum=0, maximum=1
    )
    prior_vergence_sigma_rad: float = parameter(0.08, "its standard deviation", unit="rad", minimum=0.001, maximum=1)
    fovea_radius_rad: float = parameter(
        0.03,
        "how far off the fovea the fovea's disparity still is the target's",
        unit="rad",
        minimum=0.001,
        maximum=0.5,
    )
    adopt_radius_rad: float = parameter(
        0.07, "how far from the wanted target a track may be to be taken for it", unit="rad", minimum=0.001, maximum=1
    )
    minimum_confidence: float = parameter(0.3, "disparities of less confidence are not used", minimum=0, maximum=1)
    direction_sigma_rad: float = parameter(
        0.0006, "standard deviation of a direction in one eye", unit="rad", minimum=1e-5, maximum=0.1
    )
    point_sigma_rad: float = parameter(
        0.002, "standard deviation of a point given by gaze/target", unit="rad", minimum=1e-5, maximum=0.2
    )

    contrast: str = parameter(
        "required", "the edge contrast's part in `verged`", choices=("required", "when_seen", "ignored")
    )
    contrast_enter: float = parameter(0.72, "contrast below which the eyes may be verged", minimum=0, maximum=2)
    contrast_leave: float = parameter(0.9, "contrast above which they no longer are", minimum=0, maximum=2)
    verged_enter_rad: float = parameter(
        0.0085,
        "vergence error below which the eyes may be verged; directions: this or the servos' dead band",
        unit="rad",
        minimum=1e-4,
        maximum=0.2,
    )
    verged_leave_rad: float = parameter(
        0.0155, "error above which they no longer are", unit="rad", minimum=1e-4, maximum=0.2
    )
    verged_pairs: int = parameter(2, "pairs in a row that must say verged", minimum=1, maximum=100)
    verged_doubt: float = parameter(
        0.002,
        "probability that the eyes are off after all, up to which one pair suffices; 0: never",
        minimum=0,
        maximum=1,
    )
    unverged_pairs: int = parameter(4, "pairs in a row that must say not verged any more", minimum=1, maximum=100)

    lost_after_s: float = parameter(
        0.35, "time without a sighting until the target is lost", unit="s", minimum=0.05, maximum=60
    )
    search_after_s: float = parameter(1.0, "time lost until the eyes search", unit="s", minimum=0, maximum=600)
    search_dwell_s: float = parameter(0.3, "rest at each place of the search", unit="s", minimum=0.02, maximum=10)
    no_images_s: float = parameter(
        2.0, "time without any image result until a goal fails", unit="s", minimum=0.1, maximum=600
    )
    disagreement_rad: float = parameter(
        0.02,
        "difference of two estimators beyond the object's own depth that stops the eyes",
        unit="rad",
        minimum=0.001,
        maximum=1,
    )

    def check(self) -> None:
        """Hold the hystereses in order."""
        if self.contrast_leave < self.contrast_enter:
            raise ParameterError(
                "contrast_leave", self.contrast_leave, f"at least contrast_enter, {self.contrast_enter:g}"
            )
        if self.verged_leave_rad < self.verged_enter_rad:
            raise ParameterError(
                "verged_leave_rad", self.verged_leave_rad, f"at least verged_enter_rad, {self.verged_enter_rad:g} [rad]"
            )


@dataclass(frozen=True)
class GazeNodeParameters(GazeParameters):
    """The controller's parameters and the node's own."""

    rig: str = parameter("", "path of rig.yaml; empty for the built-in rig", read_only=True)
    control_rate_hz: float = parameter(
        50.0, "control cycles a second", unit="Hz", minimum=5, maximum=1000, read_only=True
    )


GROUPS: Groups = (("", GazeNodeParameters),)
