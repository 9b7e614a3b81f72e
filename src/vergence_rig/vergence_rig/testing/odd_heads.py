"""Heads whose every dimension is off: mounts, axes, zeros and scales as printed ones have them, and a little beyond."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

from vergence_rig.rig import EyeMount, Joints, Rig

SHARES = 25
"""How many numbers `odd_head` needs."""

_MOUNT = {
    "axis_x_m": 0.01,
    "axis_z_m": 0.003,
    "lens_x_m": 0.04,
    "lens_y_m": 0.005,
    "lens_z_m": 0.003,
    "roll_rad": 0.1,
    "pitch_rad": 0.08,
    "yaw_rad": 0.1,
}


def odd_head(shares: Sequence[float]) -> Rig:
    """Return the head whose dimensions are these shares (SHARES), -1 to 1, of what they may be off."""
    share = iter(shares)
    joints = [
        replace(joint, zero_rad=0.1 * next(share), scale=1.0 + 0.1 * next(share)) for _, joint in Rig().joints.items()
    ]
    return Rig(
        baseline_m=0.1 + 0.05 * next(share),
        joints=Joints(*joints),
        left_mount=_mount(share),
        right_mount=_mount(share),
        tilt_axis_x_m=0.03 * next(share),
        tilt_axis_z_m=0.05 * next(share),
    )


def _mount(share: Iterator[float]) -> EyeMount:
    return EyeMount(**{name: most * next(share) for name, most in _MOUNT.items()})
