"""The URDF of a head: the shipped one with baseline, limits and speeds of a rig.yaml."""

from xml.etree import ElementTree

from vergence_rig.rig import JOINT_NAMES, Rig


def head_urdf(text: str, rig: Rig) -> str:
    """Return the URDF `text` for a rig: joints at half its baseline, with its limits."""
    root = ElementTree.fromstring(text)
    joints = {joint.attrib["name"]: joint for joint in root.iter("joint")}
    for name in JOINT_NAMES:
        limit, joint = joints[name].find("limit"), rig.joints[name]
        assert limit is not None
        limit.attrib |= {
            "lower": repr(joint.lower_rad),
            "upper": repr(joint.upper_rad),
            "velocity": repr(joint.max_speed_rad_s),
        }
    for name, side in (("pan_left", 1), ("pan_right", -1)):
        origin = joints[name].find("origin")
        assert origin is not None
        origin.set("xyz", f"0 {side * rig.baseline_m / 2!r} 0")
    return ElementTree.tostring(root, encoding="unicode")
