"""The executables of this package; each imports its module only when it runs."""

from vergence_rig.executable import run


def servo_node() -> int:
    """Run servo_node."""
    return run("vergence_servo.ros.servo_node")
