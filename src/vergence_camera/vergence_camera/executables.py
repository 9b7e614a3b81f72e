"""The executables of this package; each imports its module only when it runs."""

from vergence_rig.executable import run


def camera_node() -> int:
    """Run camera_node."""
    return run("vergence_camera.ros.camera_node")


def list_cameras() -> int:
    """Run list_cameras."""
    return run("vergence_camera.list_cameras", tool=True)
