"""The executables of this package; each imports its module only when it runs."""

from vergence_rig.executable import run


def edge_metric_node() -> int:
    """Run edge_metric_node."""
    return run("vergence_metric.ros.edge_metric_node")


def box_metric_node() -> int:
    """Run box_metric_node."""
    return run("vergence_metric.ros.box_metric_node")


def eye_rotation_node() -> int:
    """Run eye_rotation_node."""
    return run("vergence_metric.ros.eye_rotation_node")


def stereo_node() -> int:
    """Run stereo_node."""
    return run("vergence_metric.ros.stereo_node")
