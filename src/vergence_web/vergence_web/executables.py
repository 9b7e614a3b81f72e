"""The nodes of this package; each imports its module only when it runs."""

from vergence_rig.executable import run


def web_node() -> int:
    """Run web_node."""
    return run("vergence_web.ros.web_node")
