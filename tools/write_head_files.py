"""Writes the shipped URDF and MJCF of the built-in head from its rig, by the functions that the launch files use."""

from pathlib import Path

from vergence_rig.head_mjcf import head_mjcf
from vergence_rig.head_urdf import head_urdf
from vergence_rig.rig import default_rig

PACKAGE = Path(__file__).resolve().parent.parent / "src" / "vergence_bringup"


def main() -> None:
    """Write both files."""
    (PACKAGE / "urdf" / "vergence_head.urdf").write_text(head_urdf(default_rig()), encoding="utf-8")
    (PACKAGE / "mjcf" / "vergence_head.xml").write_text(head_mjcf(default_rig()), encoding="utf-8")


if __name__ == "__main__":
    main()
