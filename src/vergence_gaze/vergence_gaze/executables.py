"""The executables of this package; each imports its module only when it runs."""

from vergence_rig.executable import run


def gaze_controller_node() -> int:
    """Run gaze_controller_node."""
    return run("vergence_gaze.ros.gaze_controller_node")
