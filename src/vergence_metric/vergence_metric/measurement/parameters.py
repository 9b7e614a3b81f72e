"""Parameters of edge_metric_node: one group for each part of the measurement."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from vergence_metric.alignment.parameters import AlignmentParameters
from vergence_metric.disparity.parameters import DisparityParameters
from vergence_metric.edges.parameters import ContrastParameters, EdgeParameters
from vergence_metric.pairs.parameters import PairingParameters, StereoParameters
from vergence_metric.tracking.parameters import TrackerParameters
from vergence_rig.parameters import Groups, parameter, replaced_groups
from vergence_rig.verged import VergedLimits


@dataclass(frozen=True)
class VergedParameters(VergedLimits):
    """When a pair is `verged`: the controller's limits of contrast and signed error, with hysteresis."""

    min_confidence: float = parameter(
        0.5,
        "least confidence of a signed error that counts for `verged`; with less the error is unknown",
        minimum=0.0,
        maximum=1.0,
        formerly="verged_confidence",
    )


@dataclass(frozen=True)
class PairMeasurementParameters:
    """The groups that the measurement of a pair needs."""

    edges: EdgeParameters = field(default_factory=EdgeParameters)
    contrast: ContrastParameters = field(default_factory=ContrastParameters)
    alignment: AlignmentParameters = field(default_factory=AlignmentParameters)
    verged: VergedParameters = field(default_factory=VergedParameters)
    disparity: DisparityParameters = field(default_factory=DisparityParameters)
    tracker: TrackerParameters = field(default_factory=TrackerParameters)


_PAIR: Groups = (
    ("edges.", EdgeParameters),
    ("contrast.", ContrastParameters),
    ("align.", AlignmentParameters),
    ("verged.", VergedParameters),
    ("disparity.", DisparityParameters),
    ("tracker.", TrackerParameters),
)

GROUPS: Groups = (("", StereoParameters), ("pair.", PairingParameters), *_PAIR)


def pair_measurement_parameters(values: Mapping[str, Any]) -> PairMeasurementParameters:
    """Return the parameters with some values changed by their full names, such as "edges.windows_px".

    Raises ParameterError, with the full name, for an unknown name or an invalid value.
    """
    groups: tuple[Any, ...] = replaced_groups(_PAIR, values)
    return PairMeasurementParameters(*groups)
