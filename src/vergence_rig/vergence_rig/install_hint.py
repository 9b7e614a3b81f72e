"""The command that installs a Python package which apt lacks, as this machine's Python accepts it."""

import sys
import sysconfig
from pathlib import Path

_MARKER = "EXTERNALLY-MANAGED"
"""PEP 668: with this file beside the standard library pip refuses to install outside a virtual environment."""


def install_hint(*packages: str) -> str:
    """Return the command for these packages, with the reason for its flags where it has any."""
    names = " ".join(packages)
    if in_virtual_environment():
        return f"python3 -m pip install {names}"
    if externally_managed():
        return (
            f"python3 -m pip install --user --break-system-packages {names} (without that flag this system's pip "
            "refuses, PEP 668; with --user the system's own packages stay as they are), or use a virtual environment "
            "(README, 'On a ROS machine')"
        )
    return f"python3 -m pip install --user {names}"


def in_virtual_environment() -> bool:
    """Return True if this Python runs in a virtual environment."""
    return sys.prefix != sys.base_prefix


def externally_managed() -> bool:
    """Return True if this Python's pip refuses to install outside a virtual environment (PEP 668)."""
    return (Path(sysconfig.get_path("stdlib")) / _MARKER).is_file()
