"""Parameters of edge_metric_node: one group for each part of the measurement."""

from dataclasses import dataclass, field

from vergence_metric.alignment.parameters import AlignmentParameters
from vergence_metric.disparity.parameters import DisparityParameters
from vergence_metric.edges.parameters import ContrastParameters, EdgeParameters
from vergence_metric.pairs.parameters import PairingParameters, StereoParameters
from vergence_metric.tracking.parameters import TrackerParameters
from vergence_rig.parameters import Groups, ParameterError, Parameters, parameter


@dataclass(frozen=True)
class VergedParameters(Parameters):
    """When a pair is `verged`: thresholds with hysteresis on the foveal contrast and the signed error."""

    enter_contrast: float = parameter(
        0.6, "foveal contrast up to which `verged` can be set", minimum=0.0, maximum=2.0, formerly="verged_contrast"
    )
    leave_contrast: float = parameter(
        0.72,
        "foveal contrast above which `verged` is cleared",
        minimum=0.0,
        maximum=2.0,
        formerly="verged_leave_contrast",
    )
    enter_px: float = parameter(
        2.0,
        "absolute signed error up to which `verged` can be set",
        unit="px",
        minimum=0.0,
        maximum=1000.0,
        formerly="verged_px",
    )
    leave_px: float = parameter(
        4.0,
        "absolute signed error above which `verged` is cleared",
        unit="px",
        minimum=0.0,
        maximum=1000.0,
        formerly="verged_leave_px",
    )
    min_confidence: float = parameter(
        0.5,
        "least confidence of a signed error that counts for `verged`; with less the error is unknown",
        minimum=0.0,
        maximum=1.0,
        formerly="verged_confidence",
    )

    def check(self) -> None:
        """Raise ParameterError where a threshold to leave is below the one to enter."""
        for enter, leave in (("enter_contrast", "leave_contrast"), ("enter_px", "leave_px")):
            if getattr(self, leave) < getattr(self, enter):
                raise ParameterError(leave, getattr(self, leave), f"at least {enter} ({getattr(self, enter):g})")


@dataclass(frozen=True)
class PairMeasurementParameters:
    """The groups that the measurement of a pair needs."""

    edges: EdgeParameters = field(default_factory=EdgeParameters)
    contrast: ContrastParameters = field(default_factory=ContrastParameters)
    alignment: AlignmentParameters = field(default_factory=AlignmentParameters)
    verged: VergedParameters = field(default_factory=VergedParameters)
    disparity: DisparityParameters = field(default_factory=DisparityParameters)
    tracker: TrackerParameters = field(default_factory=TrackerParameters)


GROUPS: Groups = (
    ("", StereoParameters),
    ("pair.", PairingParameters),
    ("edges.", EdgeParameters),
    ("contrast.", ContrastParameters),
    ("align.", AlignmentParameters),
    ("verged.", VergedParameters),
    ("disparity.", DisparityParameters),
    ("tracker.", TrackerParameters),
)
