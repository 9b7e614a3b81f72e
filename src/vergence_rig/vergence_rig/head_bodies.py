"""The bodies of a head, from its rig: one list from which the URDF and MuJoCo's MJCF are written.

Each body has a frame with x forward, y left, z up, except the optical frames (x right, y down, z forward). With every
axis at 0 a body stands in its parent at `place_m`, turned by roll, then pitch, then yaw about the parent's fixed axes.
"""

import math
from dataclasses import dataclass

from vergence_rig.rig import JOINT_NAMES, Rig

Triple = tuple[float, float, float]

BASE = "rig_base"
TILT = "tilt_link"
EYES = ("left", "right")
PAN_LINKS = {eye: f"{eye}_pan_link" for eye in EYES}
CAMERAS = {eye: f"{eye}_camera" for eye in EYES}
OPTICAL_FRAMES = {eye: f"{eye}_camera_optical_frame" for eye in EYES}

_DARK, _BLUE, _STEEL = (0.09, 0.09, 0.1), (0.1, 0.2, 0.5), (0.6, 0.62, 0.64)
_TO_OPTICAL: Triple = (-0.5 * math.pi, 0.0, -0.5 * math.pi)
_NONE: Triple = (0.0, 0.0, 0.0)
_BESIDE_SERVOS_M = 0.03


@dataclass(frozen=True)
class Shape:
    """A box (full sizes x, y, z) or a cylinder (radius, length) [m] in a body's frame; its colour RGB, 0 to 1 each."""

    name: str
    kind: str
    size_m: tuple[float, ...]
    place_m: Triple
    colour: Triple
    roll_pitch_yaw_rad: Triple = _NONE


@dataclass(frozen=True)
class Body:
    """One body. `joint` names the hinge that turns it about `axis` of its own frame; "" for a fixed one."""

    name: str
    parent: str
    place_m: Triple = _NONE
    roll_pitch_yaw_rad: Triple = _NONE
    joint: str = ""
    axis: Triple = _NONE
    shapes: tuple[Shape, ...] = ()


def head_bodies(rig: Rig) -> tuple[Body, ...]:
    """Return a head's bodies, parents first: rig_base, tilt_link, and each eye's pan link, camera and optical frame.

    A hinge's angle is its axis's, `zero_rad + scale * joint`: the writers put zeros and scales in.
    """
    tilt_x, tilt_z = rig.tilt_axis_x_m, rig.tilt_axis_z_m
    bodies = [
        Body(BASE, "", shapes=(_box("base", (0.05, 0.05, 0.06), (tilt_x, 0.0, tilt_z - 0.06), _DARK),)),
        Body(TILT, BASE, (tilt_x, 0.0, tilt_z), _NONE, "tilt", (0.0, 1.0, 0.0), _bar(rig)),
    ]
    for eye, side, joint in zip(EYES, (1.0, -1.0), JOINT_NAMES, strict=False):
        mount, half = rig.mount(eye == "left"), 0.5 * rig.baseline_m
        place = (mount.axis_x_m - tilt_x, side * half, mount.axis_z_m - tilt_z)
        servo = _box(f"{eye}_servo", (0.012, 0.023, 0.026), (0.0, 0.0, -0.032), _BLUE)
        bodies += [
            Body(PAN_LINKS[eye], TILT, place, _NONE, joint, (0.0, 0.0, 1.0), (servo,)),
            Body(
                CAMERAS[eye],
                PAN_LINKS[eye],
                (mount.lens_x_m, mount.lens_y_m, mount.lens_z_m),
                (mount.roll_rad, mount.pitch_rad, mount.yaw_rad),
                shapes=_camera(eye),
            ),
            Body(OPTICAL_FRAMES[eye], CAMERAS[eye], _NONE, _TO_OPTICAL),
        ]
    return tuple(bodies)


def _camera(eye: str) -> tuple[Shape, Shape]:
    return (
        _box(f"{eye}_housing", (0.036, 0.044, 0.032), (-0.02, 0.0, 0.0), _DARK),
        Shape(f"{eye}_lens", "cylinder", (0.008, 0.008), (-0.001, 0.0, 0.0), _STEEL, (0.0, 0.5 * math.pi, 0.0)),
    )


def _bar(rig: Rig) -> tuple[Shape, Shape]:
    """Return the bar under both servos and the upright that carries it from the tilt axis."""
    pans_x = 0.5 * (rig.left_mount.axis_x_m + rig.right_mount.axis_x_m) - rig.tilt_axis_x_m
    pans_z = 0.5 * (rig.left_mount.axis_z_m + rig.right_mount.axis_z_m) - rig.tilt_axis_z_m
    under = pans_z - 0.05
    upright = (abs(pans_x) + 0.008, 0.02, abs(under) + 0.008)
    return (
        _box("bar", (0.024, rig.baseline_m + 2.0 * _BESIDE_SERVOS_M, 0.008), (pans_x, 0.0, under), _STEEL),
        _box("upright", upright, (0.5 * pans_x, 0.0, 0.5 * under), _STEEL),
    )


def _box(name: str, size_m: Triple, place_m: Triple, colour: Triple) -> Shape:
    return Shape(name, "box", size_m, place_m, colour)
