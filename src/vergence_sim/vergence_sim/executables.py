"""The executables of this package; each imports its module only when it runs."""

from vergence_rig.executable import run


def photo_node() -> int:
    """Run photo_node."""
    return run("vergence_sim.ros.photo_node")


def sim_node() -> int:
    """Run sim_node."""
    return run("vergence_sim.ros.sim_node", optional=("mujoco",))
