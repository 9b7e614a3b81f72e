"""All parameter groups of gaze_controller_node: the fixed ones and those of every registered law."""

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any

import vergence_gaze.laws  # noqa: F401  registers the shipped laws
from vergence_gaze.attention_parameters import AttentionParameters
from vergence_gaze.law_registry import law_groups
from vergence_gaze.parameters import (
    ExposureParameters,
    GazeNodeParameters,
    GazeParameters,
    SaccadeParameters,
    SearchParameters,
    ServoParameters,
)
from vergence_gaze.target_parameters import TargetParameters
from vergence_gaze.verged_parameters import VergedParameters
from vergence_rig.parameters import Groups, Parameters, replaced_groups

_FIXED: Groups = (
    ("", GazeNodeParameters),
    ("saccade.", SaccadeParameters),
    ("exposure.", ExposureParameters),
    ("servo.", ServoParameters),
    ("target.", TargetParameters),
    ("verged.", VergedParameters),
    ("search.", SearchParameters),
    ("attention.", AttentionParameters),
)
_NONE: Mapping[str, Any] = MappingProxyType({})


def gaze_groups() -> Groups:
    """Return all groups, those of laws that were registered later included."""
    return _FIXED + law_groups()


GROUPS: Groups = gaze_groups()
"""The groups as shipped."""


def collected(groups: Iterable[Parameters]) -> GazeParameters:
    """Return the controller's parameters from one instance of every group."""
    by_kind: dict[type[Parameters], Any] = {type(group): group for group in groups}
    control, saccade, exposure, servo, target, verged, search, attention = (by_kind[kind] for _, kind in _FIXED)
    laws = tuple(by_kind[kind] for _, kind in law_groups())
    return GazeParameters(control, saccade, exposure, servo, target, verged, search, attention, laws)


def gaze_parameters(values: Mapping[str, Any] = _NONE) -> GazeParameters:
    """Return validated parameters from full names such as "verged.enter_rad"; the others have their defaults.

    Raises ParameterError, with the full name, for an unknown name or an invalid value.
    """
    return collected(replaced_groups(gaze_groups(), values))
