"""The nodes of this package; each imports its module only when it runs."""

from vergence_rig.executable import run


def head_node() -> int:
    """Run head_node."""
    return run("vergence_bringup.ros.head_node")
