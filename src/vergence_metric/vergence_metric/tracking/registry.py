"""Trackers by name. `register_tracker` adds one; the parameter `tracker.kind` chooses one.

This module imports no parameters, because the parameters take the allowed names from here.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from vergence_metric.tracking.protocol import Tracker

TrackerBuilder = Callable[..., "Tracker"]

_BUILDERS: dict[str, TrackerBuilder] = {}


def register_tracker(name: str, build: TrackerBuilder) -> None:
    """Add a tracker under a name that is free; raises ValueError for one in use."""
    if name in _BUILDERS:
        raise ValueError(f"the name of a tracker must be new: got {name!r}, which is registered")
    _BUILDERS[name] = build


def tracker_names() -> tuple[str, ...]:
    """Return the names of all registered trackers, in order of registration."""
    return tuple(_BUILDERS)


def make_tracker(parameters: Any, *arguments: Any) -> "Tracker":
    """Return the tracker that `parameters.kind` names; raises KeyError for a name that is not registered."""
    return _BUILDERS[parameters.kind](parameters, *arguments)
