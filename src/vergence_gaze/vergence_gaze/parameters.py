"""The gaze controller's parameters, in groups; each control law describes its own beside itself.

Default angles have 17 digits so that the YAML equals them exactly.
"""

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from vergence_gaze.attention_parameters import AttentionParameters
from vergence_gaze.law_registry import law_names
from vergence_gaze.target_parameters import TargetParameters
from vergence_gaze.verged_parameters import VergedParameters
from vergence_rig.parameters import Parameters, parameter

LONGEST_GOAL_S = 600.0
"""Largest time limit of a goal [s]."""

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
        "behaviour without a goal: idle holds still, verge verges on what the left eye sees before the first goal, "
        "attend looks at what is of interest, as attention.* says",
        choices=("idle", "verge", "attend"),
    )
    time_limit_s: float = parameter(
        5.0,
        "time limit of a goal that states none; the goal then fails",
        unit="s",
        minimum=0.1,
        maximum=LONGEST_GOAL_S,
    )
    no_images_s: float = parameter(
        2.0,
        "time without any result from the images after which a goal fails with NO_IMAGES",
        unit="s",
        minimum=0.1,
        maximum=600,
    )
    no_feedback_s: float = parameter(
        2.0,
        "time without usable joint_states, or with a joint that does not follow its commands, after which a goal fails "
        "with NO_FEEDBACK",
        unit="s",
        minimum=0.1,
        maximum=600,
    )
    limits_after_s: float = parameter(
        0.5,
        "time for which the target needs angles beyond the joints' limits after which a goal fails with LIMITS",
        unit="s",
        minimum=0,
        maximum=600,
    )
    ambiguous_after_s: float = parameter(
        3.0,
        "time for which several distances or places fit the target after which a goal fails with AMBIGUOUS",
        unit="s",
        minimum=0.1,
        maximum=600,
    )
    search_limit_s: float = parameter(
        2.5,
        "time of searching for a target that was requested by its place after which a goal fails with LOST",
        unit="s",
        minimum=0.1,
        maximum=600,
    )

    @property
    def driven(self) -> npt.NDArray[np.bool_]:
        """Which joints (3,) may move: pan_left, pan_right, tilt."""
        return np.array([self.mode != "left_held", self.mode != "right_held", self.tilt_enabled])


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
    attention: AttentionParameters
    laws: tuple[Parameters, ...]

    def of_law(self, kind: type[Group]) -> Group:
        """Return a law's own parameters, which are of class `kind`."""
        return next(group for group in self.laws if type(group) is kind)
