"""The URDF of a head, for robot_state_publisher, RViz and other simulators.

URDF joints turn by what joint_states say. Where an axis turns otherwise, by `zero_rad + scale * joint`, the joint of
joint_states' name turns an empty link, and the axis mimics it.
"""

from vergence_rig.head_bodies import Body, Shape, head_bodies
from vergence_rig.rig import JointSpec, Rig

_EFFORT_NM = {"pan_left": 0.2, "pan_right": 0.2, "tilt": 1.0}
_NONE = (0.0, 0.0, 0.0)


def head_urdf(rig: Rig) -> str:
    """Return the URDF document of a rig. Its joints are JOINT_NAMES, with the rig's limits and speeds."""
    bodies = head_bodies(rig)
    lines = [
        '<?xml version="1.0"?>',
        "<!-- Made from rig.yaml. x forward, y left, z up; pan > 0 looks left, tilt > 0 looks down. -->",
        '<robot name="vergence_head">',
    ]
    for body in bodies:
        lines += _link(body)
        if body.joint:
            lines += _hinge(body, rig.joints[body.joint])
        elif body.parent:
            lines += _joint(f"{body.name}_joint", "fixed", body)
    return "\n".join([*lines, "</robot>", ""])


def _hinge(body: Body, spec: JointSpec) -> list[str]:
    limits = (spec.lower_rad, spec.upper_rad, spec.max_speed_rad_s)
    if spec.zero_rad == 0.0 and spec.scale == 1.0:
        return _joint(body.joint, "revolute", body, _turn(body, limits))
    servo = Body(f"{body.joint}_servo", body.parent, body.place_m, body.roll_pitch_yaw_rad)
    of_axis = (spec.axis_rad(spec.lower_rad), spec.axis_rad(spec.upper_rad), spec.scale * spec.max_speed_rad_s)
    mimic = f'    <mimic joint="{body.joint}" multiplier="{spec.scale!r}" offset="{spec.zero_rad!r}"/>'
    return [
        f'  <link name="{servo.name}"/>',
        *_joint(body.joint, "revolute", servo, _turn(body, limits)),
        *_joint(f"{body.joint}_axis", "revolute", body, [*_turn(body, of_axis), mimic]),
    ]


def _turn(body: Body, limits: tuple[float, float, float]) -> list[str]:
    lower, upper, speed = limits
    effort = _EFFORT_NM[body.joint]
    return [
        f'    <axis xyz="{_text(body.axis)}"/>',
        f'    <limit lower="{lower!r}" upper="{upper!r}" velocity="{speed!r}" effort="{effort!r}"/>',
    ]


def _joint(name: str, kind: str, body: Body, inside: list[str] | None = None) -> list[str]:
    return [
        f'  <joint name="{name}" type="{kind}">',
        f'    <parent link="{body.parent}"/><child link="{body.name}"/>',
        f"    {_origin(body.place_m, body.roll_pitch_yaw_rad)}",
        *(inside or []),
        "  </joint>",
    ]


def _link(body: Body) -> list[str]:
    if not body.shapes:
        return [f'  <link name="{body.name}"/>']
    return [f'  <link name="{body.name}">', *map(_visual, body.shapes), "  </link>"]


def _visual(shape: Shape) -> str:
    size = f'<box size="{_text(shape.size_m)}"/>'
    if shape.kind == "cylinder":
        radius, length = shape.size_m
        size = f'<cylinder radius="{radius!r}" length="{length!r}"/>'
    look = f'<material name="{shape.name}"><color rgba="{_text(shape.colour)} 1"/></material>'
    return f"    <visual>{_origin(shape.place_m, shape.roll_pitch_yaw_rad)}<geometry>{size}</geometry>{look}</visual>"


def _origin(place_m: tuple[float, float, float], turn_rad: tuple[float, float, float]) -> str:
    turn = "" if turn_rad == _NONE else f' rpy="{_text(turn_rad)}"'
    return f'<origin xyz="{_text(place_m)}"{turn}/>'


def _text(values: tuple[float, ...]) -> str:
    return " ".join(repr(float(value)) for value in values)
