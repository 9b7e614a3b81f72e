"""The middleware that RMW_IMPLEMENTATION asks for: rcl ends the process while it is imported if that is not there."""

import os
from collections.abc import Mapping
from pathlib import Path

VARIABLE = "RMW_IMPLEMENTATION"
_INDEX = Path("share", "ament_index", "resource_index", "rmw_typesupport")
_NO_MIDDLEWARE = "rmw_implementation"


def installed_middlewares(environment: Mapping[str, str] = os.environ) -> tuple[str, ...]:
    """Return the names of the middlewares in the ament index; none where no index is found."""
    found: set[str] = set()
    for prefix in filter(None, environment.get("AMENT_PREFIX_PATH", "").split(os.pathsep)):
        folder = Path(prefix) / _INDEX
        if folder.is_dir():
            found |= set(os.listdir(folder))
    return tuple(sorted(found - {_NO_MIDDLEWARE}))


def middleware_problem(environment: Mapping[str, str] = os.environ) -> str:
    """Return why no node can start with RMW_IMPLEMENTATION as it is; "" where nothing is wrong with it."""
    wanted, installed = environment.get(VARIABLE, ""), installed_middlewares(environment)
    if not wanted or not installed or wanted in installed:
        return ""
    return (
        f"{VARIABLE} must be a middleware that is installed ({', '.join(installed)}): got {wanted!r}; "
        f"unset {VARIABLE} for ROS's default"
    )
