"""Parameters of attention without a goal: what is looked at, in which order, for how long and how fast."""

from dataclasses import dataclass

from vergence_rig.parameters import ParameterError, Parameters, parameter

DISABLED, RANDOM, SOCIAL, FOCUSED = "disabled", "random", "social", "focused"

POLICIES = (DISABLED, RANDOM, SOCIAL, FOCUSED)
"""Policies of attention, named as in PAL's attention manager."""


@dataclass(frozen=True)
class AttentionParameters(Parameters):
    """Where the eyes go while no goal is active; see `attention.manager`."""

    policy: str = parameter(
        SOCIAL,
        "policy of attention while start is attend, until gaze/attention names another one: social looks at objects of "
        "attention.classes with glances at others and scans the room; focused keeps to one object; random looks "
        "anywhere; disabled holds still",
        choices=POLICIES,
    )
    classes: tuple[str, ...] = parameter(
        ("face", "person", "cube", "motion"),
        "classes of objects that are looked at, in order of interest; motion is whatever moves",
    )
    min_dwell_s: float = parameter(
        1.0,
        "least time on one object before an object of a more interesting class takes over",
        unit="s",
        minimum=0,
        maximum=600,
    )
    gone_after_s: float = parameter(
        1.5,
        "time without a sighting after which an object is given up, and the next one looked at or the room scanned",
        unit="s",
        minimum=0.1,
        maximum=600,
    )
    glance_every_s: float = parameter(
        8.0,
        "time on one object after which the policy social glances at another one; 0 for no glances",
        unit="s",
        minimum=0,
        maximum=3600,
    )
    glance_s: float = parameter(
        1.0, "time on the object that is glanced at, before the eyes return", unit="s", minimum=0.1, maximum=60
    )
    scan_speed_rad_s: float = parameter(
        0.8,
        "largest speed of a joint while the room is scanned; a faster scan blurs what the detector sees",
        unit="rad/s",
        minimum=0.02,
        maximum=10,
    )
    scan_dwell_s: float = parameter(
        0.3, "time at each place of the scan, in which motion can be seen", unit="s", minimum=0.02, maximum=60
    )
    random_dwell_s: float = parameter(
        2.0, "time at each place of the policy random", unit="s", minimum=0.1, maximum=600
    )
    speed_rad_s: float = parameter(
        2.5, "largest speed of a joint while attention turns the eyes", unit="rad/s", minimum=0.05, maximum=100
    )
    acceleration_rad_s2: float = parameter(
        20.0,
        "largest acceleration of a joint while attention turns the eyes",
        unit="rad/s^2",
        minimum=0.1,
        maximum=10000,
    )
    after_goal_s: float = parameter(
        5.0,
        "time after the end of a goal, or after the last point of gaze/target, in which its target is still followed, "
        "unless it is lost, before attention resumes",
        unit="s",
        minimum=0,
        maximum=3600,
    )

    def check(self) -> None:
        """Raise ParameterError for a class without a name or named twice."""
        super().check()
        if "" in self.classes or len(set(self.classes)) != len(self.classes):
            raise ParameterError("classes", self.classes, "different names of classes, none of them empty")
