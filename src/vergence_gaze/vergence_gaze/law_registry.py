"""The control laws by name: `register_law` adds one, the parameter `law` chooses one.

A law is a class with a `name`, a `Parameters` class of its own, and the methods of `laws.protocol.Law`; it is built
from the rig and the GazeParameters. Its parameters are declared under its name, such as `pid_pursuit.kp`. This module
imports neither laws nor parameters, because the parameters take the allowed names from here.
"""

from typing import Any, TypeAlias

from vergence_rig.parameters import Groups

LawClass: TypeAlias = type[Any]

_LAWS: dict[str, LawClass] = {}


def register_law(law: LawClass) -> LawClass:
    """Add a law under its `name`; raises ValueError for a name in use. Usable as a class decorator."""
    if law.name in _LAWS:
        raise ValueError(f"the name of a control law must be new: got {law.name!r}, which is registered")
    _LAWS[law.name] = law
    return law


def law_names() -> tuple[str, ...]:
    """Return the names of all registered laws, in order of registration."""
    return tuple(_LAWS)


def law_class(name: str) -> LawClass:
    """Return a law's class; raises KeyError for a name that is not registered."""
    return _LAWS[name]


def law_groups() -> Groups:
    """Return each law's parameter class with the prefix of its names."""
    return tuple((f"{name}.", law.Parameters) for name, law in _LAWS.items())
