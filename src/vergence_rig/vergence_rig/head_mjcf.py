"""The MJCF of a head, for MuJoCo: its bodies for any world, and a document of the head alone.

Hinges have the names of the joints, but their angles are the axes': `zero_rad + scale * joint`.
"""

import math
from collections.abc import Mapping

from vergence_rig.head_bodies import CAMERAS, EYES, Body, Shape, head_bodies
from vergence_rig.rig import Rig

Triple = tuple[float, float, float]

_LENS_FROM_CAMERA = "0 -1 0 0 0 1"
"""MuJoCo's cameras look along -z with x to the right: its x and y axes in the camera's frame."""


def mjcf_bodies(rig: Rig, inside: Mapping[str, str] | None = None, group: int = 0, shapes: bool = True) -> str:
    """Return a head's bodies as MJCF, rig_base outermost at the origin.

    Args:
        rig: the head.
        inside: further MJCF for bodies, by name.
        group: of the shapes.
        shapes: False for the kinematics alone.
    """
    bodies = head_bodies(rig)
    return _nested(bodies[0], bodies, inside or {}, group, shapes)


def head_mjcf(rig: Rig) -> str:
    """Return the MJCF document of a head alone, with both cameras' vertical fields of view."""
    cameras = {CAMERAS[eye]: camera_mjcf(eye, rig) for eye in EYES}
    return "\n".join(
        [
            "<!-- Made from rig.yaml. x forward, y left, z up; pan > 0 looks left, tilt > 0 looks down. -->",
            '<mujoco model="vergence_head"><compiler angle="radian"/>',
            "<worldbody>",
            mjcf_bodies(rig, cameras),
            "</worldbody>",
            "</mujoco>",
            "",
        ]
    )


def camera_mjcf(eye: str, rig: Rig, fovy_rad: float | None = None) -> str:
    """Return an eye's camera for the body of CAMERAS; `fovy_rad` is its own unless given."""
    spec = rig.camera(eye == "left")
    fovy_rad = 2.0 * math.atan(0.5 * spec.height_px / spec.fy_px) if fovy_rad is None else fovy_rad
    return f'<camera name="{eye}" xyaxes="{_LENS_FROM_CAMERA}" fovy="{math.degrees(fovy_rad)!r}"/>'


def _nested(body: Body, bodies: tuple[Body, ...], inside: Mapping[str, str], group: int, shapes: bool) -> str:
    parts = [f'<body name="{body.name}" pos="{_text(body.place_m)}" quat="{quaternion_text(body.roll_pitch_yaw_rad)}">']
    if body.joint:
        parts.append(f'<joint name="{body.joint}" type="hinge" axis="{_text(body.axis)}"/>')
    parts.append('<inertial pos="0 0 0" mass="0.05" diaginertia="1e-4 1e-4 1e-4"/>')
    parts += [_geom(shape, group) for shape in body.shapes] if shapes else []
    parts.append(inside.get(body.name, ""))
    parts += [_nested(child, bodies, inside, group, shapes) for child in bodies if child.parent == body.name]
    return "\n".join([*filter(None, parts), "</body>"])


def _geom(shape: Shape, group: int) -> str:
    if shape.kind == "cylinder":
        radius, length = shape.size_m
        sizes: tuple[float, ...] = (radius, 0.5 * length)
    else:
        sizes = tuple(0.5 * side for side in shape.size_m)
    return (
        f'<geom name="{shape.name}" type="{shape.kind}" pos="{_text(shape.place_m)}" size="{_text(sizes)}"'
        f' quat="{quaternion_text(shape.roll_pitch_yaw_rad)}" group="{group}" rgba="{_text(shape.colour)} 1"'
        ' contype="0" conaffinity="0"/>'
    )


def quaternion_text(roll_pitch_yaw_rad: Triple) -> str:
    """Return a turn by roll, then pitch, then yaw about fixed axes as a quaternion w x y z."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(0.5 * a), math.sin(0.5 * a)) for a in roll_pitch_yaw_rad)
    return _text(
        (
            cy * cp * cr + sy * sp * sr,
            cy * cp * sr - sy * sp * cr,
            cy * sp * cr + sy * cp * sr,
            sy * cp * cr - cy * sp * sr,
        )
    )


def _text(values: tuple[float, ...]) -> str:
    return " ".join(repr(float(value)) for value in values)
