"""Parameters of eye_rotation_node: its input, when it measures, what it looks for and what it believes."""

from dataclasses import dataclass

from vergence_metric.pairs.stereo_parameters import StereoParameters
from vergence_rig.parameters import Groups, Parameters, parameter


@dataclass(frozen=True)
class EncoderParameters(Parameters):
    """How the eyes' relative rotation is measured on a pair."""

    features: int = parameter(400, "corners looked for, evenly over the left image", minimum=60, maximum=5000)
    nearest_m: float = parameter(
        0.22, "matches are looked for from infinity to this distance", unit="m", minimum=0.05, maximum=10.0
    )
    row_search_px: float = parameter(
        14.0, "matches may lie this far above or below: roll and pitch of the mounts", unit="px", minimum=2, maximum=60
    )
    match_score: float = parameter(0.8, "least correlation of a match, at half resolution", minimum=0.3, maximum=0.999)
    rival_score: float = parameter(
        0.96,
        "a match whose second best place scores more than this share of its best is left out",
        minimum=0.5,
        maximum=1,
    )
    mount_tolerance_rad: float = parameter(
        0.0175,
        "beyond the servos' play, this much difference from the joints is believed",
        unit="rad",
        minimum=0.0,
        maximum=0.3,
    )
    least_inliers: int = parameter(60, "fewer agreeing matches are no measurement", minimum=30, maximum=5000)
    least_inlier_share: float = parameter(
        0.6, "a smaller share of agreeing matches is no measurement", minimum=0.1, maximum=1.0
    )
    most_residual_px: float = parameter(
        0.6,
        "inliers farther from their epipolar lines than this are no measurement",
        unit="px",
        minimum=0.01,
        maximum=10,
    )
    most_sigma_rad: float = parameter(
        0.0035, "a vergence less certain than this is not given out", unit="rad", minimum=1e-5, maximum=0.1
    )
    focal_doubt: float = parameter(
        0.001, "standard deviation of each focal length as calibrated, relative", minimum=0.0, maximum=0.1
    )
    distortion_doubt: float = parameter(
        0.002, "standard deviation of each lens's k1 as calibrated", minimum=0.0, maximum=0.5
    )
    centre_doubt_px: float = parameter(
        0.1,
        "standard deviation of each principal point as calibrated: what the pans' zero has not taken up",
        unit="px",
        minimum=0.0,
        maximum=20.0,
    )
    most_motion_px: float = parameter(
        0.15, "the view may move by this from the left to the right exposure", unit="px", minimum=0.01, maximum=10
    )
    settle_s: float = parameter(
        0.15, "the joints have to rest for this long before an exposure", unit="s", minimum=0.0, maximum=2.0
    )
    still_rad: float = parameter(0.002, "joints that moved by less were at rest", unit="rad", minimum=1e-5, maximum=0.1)


@dataclass(frozen=True)
class EyeRotationNodeParameters(EncoderParameters, StereoParameters):
    """Everything eye_rotation_node can be told; defaults equal config/eye_rotation_node.yaml."""

    rate_hz: float = parameter(
        3.0, "measurements a second; what lies between is not even decoded", unit="Hz", minimum=0.05, maximum=30.0
    )

    def check(self) -> None:
        """Hold every part to its own rules."""
        for part in (EncoderParameters, StereoParameters):
            part.check(self)


GROUPS: Groups = (("", EyeRotationNodeParameters),)
