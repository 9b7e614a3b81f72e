"""One entry of a node's diagnostics as plain values; `vergence_common.diagnostics` publishes them."""

from collections.abc import Mapping
from dataclasses import dataclass, field

OK, WARN, ERROR, STALE = 0, 1, 2, 3
"""Levels, equal to those of diagnostic_msgs/DiagnosticStatus."""


@dataclass(frozen=True)
class Report:
    """Level (OK, WARN, ERROR, STALE), a sentence, and values by name."""

    level: int
    message: str
    values: Mapping[str, object] = field(default_factory=dict)
