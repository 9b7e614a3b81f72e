"""How the target is estimated, and what its sightings must fulfil."""

from dataclasses import dataclass

from vergence_rig.parameters import Parameters, parameter


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
    same_place_rad: float = parameter(
        0.02,
        "distance beside the target, beyond its own half width and the noise, up to which a sighting is in its place",
        unit="rad",
        minimum=0.001,
        maximum=0.5,
    )
    same_depth_rad: float = parameter(
        0.01,
        "difference in vergence, beyond the object's own depth and the noise, up to which a sighting is at the "
        "target's depth",
        unit="rad",
        minimum=0.0005,
        maximum=0.5,
    )
    depth_moving_s: float = parameter(
        0.35,
        "time that a moving target must be measured at another depth before it is taken to be there, and not to pass "
        "another object",
        unit="s",
        minimum=0,
        maximum=60,
    )
    distractor_persistence_s: float = parameter(
        1.0,
        "time that a target must be measured elsewhere while another source still shows it in its place; also the time "
        "after which a track of a class no longer counts without a box around it",
        unit="s",
        minimum=0,
        maximum=60,
        formerly="distractor_patience_s",
    )
    jump_gap_s: float = parameter(
        0.5,
        "time without a sighting elsewhere after which the next one there counts as the first",
        unit="s",
        minimum=0.05,
        maximum=60,
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
    lost_after_s: float = parameter(
        0.35,
        "time without a measurement of the target after which it is lost",
        unit="s",
        minimum=0.05,
        maximum=60,
        formerly="lost_after_s",
    )
