"""Parameters of eye_rotation_node: when pairs are measured, how features are matched, what a result must meet."""

from dataclasses import dataclass, field

from vergence_metric.pairs.parameters import PairingParameters, StereoParameters
from vergence_rig.parameters import Groups, Parameters, parameter


@dataclass(frozen=True)
class EyeRotationNodeParameters(StereoParameters):
    """How often eye_rotation_node measures, and where its images come from."""

    rate_hz: float = parameter(
        3.0, "rate of measurements; images in between are not decoded", unit="Hz", minimum=0.05, maximum=30.0
    )


@dataclass(frozen=True)
class RestParameters(Parameters):
    """When eyes and head count as at rest: only then a pair is measured."""

    settle_s: float = parameter(
        0.15,
        "time for which the joints must be at rest before an exposure",
        unit="s",
        minimum=0.0,
        maximum=2.0,
        formerly="settle_s",
    )
    max_joint_rad: float = parameter(
        0.002,
        "joints that move by no more than this, from rest.settle_s before an exposure to its end, are at rest",
        unit="rad",
        minimum=1e-5,
        maximum=0.1,
        formerly="still_rad",
    )
    max_image_motion_px: float = parameter(
        0.15,
        "largest motion of the left image in the time between left and right exposure",
        unit="px",
        minimum=0.01,
        maximum=10,
        formerly="most_motion_px",
    )


@dataclass(frozen=True)
class MatchingParameters(Parameters):
    """How features of the left image are matched in the right one."""

    features: int = parameter(
        400,
        "number of corners detected, spread evenly over the left image",
        minimum=60,
        maximum=5000,
        formerly="features",
    )
    nearest_m: float = parameter(
        0.22,
        "features are matched from infinity to this distance",
        unit="m",
        minimum=0.05,
        maximum=10.0,
        formerly="nearest_m",
    )
    row_search_px: float = parameter(
        14.0,
        "largest distance of a match from its epipolar row, for roll and pitch of the camera mounts",
        unit="px",
        minimum=2,
        maximum=60,
        formerly="row_search_px",
    )
    min_score: float = parameter(
        0.8,
        "least correlation of a match, at half resolution",
        minimum=0.3,
        maximum=0.999,
        formerly="match_score",
    )
    uniqueness: float = parameter(
        0.96,
        "a match is ambiguous, and left out, if a second place scores more than this share of the best one",
        minimum=0.5,
        maximum=1,
        formerly="rival_score",
    )


@dataclass(frozen=True)
class CalibrationPriorParameters(Parameters):
    """How exact the cameras' calibration is."""

    focal_sigma: float = parameter(
        0.001,
        "standard deviation of each calibrated focal length, relative",
        minimum=0.0,
        maximum=0.1,
        formerly="focal_doubt",
    )
    distortion_sigma: float = parameter(
        0.002,
        "standard deviation of each lens's calibrated k1",
        minimum=0.0,
        maximum=0.5,
        formerly="distortion_doubt",
    )
    centre_sigma_px: float = parameter(
        0.1,
        "standard deviation of each calibrated principal point, beyond what the zero of the pan joints includes",
        unit="px",
        minimum=0.0,
        maximum=20.0,
        formerly="centre_doubt_px",
    )


@dataclass(frozen=True)
class AcceptanceParameters(Parameters):
    """What a measurement must meet to be published as valid."""

    mount_tolerance_rad: float = parameter(
        0.0175,
        "largest difference of the measured vergence from the joints', beyond the servos' uncertainty",
        unit="rad",
        minimum=0.0,
        maximum=0.3,
        formerly="mount_tolerance_rad",
    )
    min_inliers: int = parameter(
        60, "least number of matches that agree on one rotation", minimum=30, maximum=5000, formerly="least_inliers"
    )
    min_inlier_share: float = parameter(
        0.6,
        "least share of matches that agree on one rotation",
        minimum=0.1,
        maximum=1.0,
        formerly="least_inlier_share",
    )
    max_residual_px: float = parameter(
        0.6,
        "largest scale of the inliers' distances from their epipolar lines",
        unit="px",
        minimum=0.01,
        maximum=10,
        formerly="most_residual_px",
    )
    max_sigma_rad: float = parameter(
        0.0035,
        "largest standard deviation of the measured vergence",
        unit="rad",
        minimum=1e-5,
        maximum=0.1,
        formerly="most_sigma_rad",
    )


@dataclass(frozen=True)
class EncoderParameters:
    """The groups that the measurement of a pair needs."""

    matching: MatchingParameters = field(default_factory=MatchingParameters)
    prior: CalibrationPriorParameters = field(default_factory=CalibrationPriorParameters)
    acceptance: AcceptanceParameters = field(default_factory=AcceptanceParameters)


GROUPS: Groups = (
    ("", EyeRotationNodeParameters),
    ("pair.", PairingParameters),
    ("rest.", RestParameters),
    ("matching.", MatchingParameters),
    ("prior.", CalibrationPriorParameters),
    ("acceptance.", AcceptanceParameters),
)
