"""The executables of this package; each imports its module only when it runs."""

from vergence_rig.executable import run


def calibrate_servos() -> int:
    """Run calibrate_servos."""
    return run("vergence_calibration.ros.calibrate_servos", tool=True)
