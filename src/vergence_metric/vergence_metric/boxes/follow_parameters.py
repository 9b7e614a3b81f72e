"""Parameters of what becomes of the detected objects: which is the target, and what moves beside them."""

from dataclasses import dataclass

from vergence_rig.parameters import Parameters, parameter

STICKY = "sticky"
POLICIES = (STICKY, "largest", "nearest", "central")
"""How the target is chosen among several objects: see `target_choice`."""


@dataclass(frozen=True)
class FollowParameters(Parameters):
    """Which of several objects is the target, and how each is recognised from one pair of images to the next."""

    policy: str = parameter(
        STICKY,
        "which of several objects is the target: sticky keeps to the one chosen before, until it is gone or a nearer "
        "one has been there for a time; largest, nearest and central choose anew in every pair",
        choices=POLICIES,
    )
    takeover_ratio: float = parameter(
        1.5,
        "how many times nearer than the target another object of its class must be to become the target with the "
        "policy sticky; where a distance is not known, how many times larger",
        minimum=1.0,
        maximum=100.0,
    )
    takeover_after_s: float = parameter(
        2.0,
        "time for which the other object must be that much nearer to become the target with the policy sticky",
        unit="s",
        minimum=0.0,
        maximum=600.0,
    )
    gate_px: float = parameter(
        60.0,
        "largest distance from an object's expected place at which it is recognised; twice as large for one that has "
        "not been seen for a second",
        unit="px",
        minimum=1.0,
        maximum=1000.0,
        formerly="follow_gate_px",
    )
    forget_after_s: float = parameter(
        2.0,
        "an object that is not seen for this long is given up; if it was the target, another one becomes the target, "
        "and if it comes back, it has another id",
        unit="s",
        minimum=0.0,
        maximum=60.0,
        formerly="forget_s",
    )


@dataclass(frozen=True)
class MotionParameters(Parameters):
    """How what moves is found beside the detector's objects, as the class motion, while the eyes rest."""

    enable: bool = parameter(True, "find what moves before eyes at rest: an object of the class motion")
    min_share: float = parameter(
        0.002, "least share of an image's area that must move to be an object", minimum=0.0001, maximum=0.5
    )
    min_change: float = parameter(
        14.0,
        "least change of brightness that counts as motion, in an eighth of the resolution; noise raises it",
        unit="grey levels",
        minimum=1.0,
        maximum=255.0,
    )
