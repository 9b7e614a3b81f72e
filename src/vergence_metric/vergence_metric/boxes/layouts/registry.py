"""Detector layouts by name. `register_layout` adds one; the parameter `detector.layout` may choose it."""

from vergence_metric.boxes.layouts.protocol import Layout

_LAYOUTS: dict[str, type[Layout]] = {}


def register_layout(layout: type[Layout]) -> None:
    """Add a layout under its `name`; raises ValueError if the name is in use."""
    if layout.name in _LAYOUTS:
        raise ValueError(f"the name of a detector layout must be new: got {layout.name!r}, which is registered")
    _LAYOUTS[layout.name] = layout


def layout_names() -> tuple[str, ...]:
    """Return the names of all registered layouts, in order of registration."""
    return tuple(_LAYOUTS)


def registered_layouts() -> tuple[type[Layout], ...]:
    """Return all registered layouts, in order of registration."""
    return tuple(_LAYOUTS.values())
