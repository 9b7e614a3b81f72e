"""The pose about which the axes are moved: near the present one, with room on both sides."""

from collections.abc import Mapping

from vergence_calibration.identification.axis_log import IdentifyError
from vergence_rig.rig import JOINT_NAMES, Rig

_MARGIN_RAD = 0.002


def pose_with_room(rig: Rig, present_rad: Mapping[str, float], amplitude_rad: float) -> dict[str, float]:
    """Return joint angles [rad] from which every joint can move by the amplitude in either direction.

    That keeps to the joints' limits and to the rig's least vergence, while one pan moves and the other rests.

    Args:
        rig: its limits.
        present_rad: the present angles of all joints.
        amplitude_rad: of the moves.

    Raises:
        IdentifyError: limits too close together for such moves.
    """
    reach_rad = amplitude_rad + _MARGIN_RAD
    bounds = {}
    for name, joint in rig.joints.items():
        low, high = joint.lower_rad + reach_rad, joint.upper_rad - reach_rad
        if low > high:
            raise IdentifyError(
                f"{name} must have a range of {2 * reach_rad:.3f} rad or more for these moves (--amplitude-deg): got "
                f"{joint.lower_rad:.3f} to {joint.upper_rad:.3f} rad"
            )
        bounds[name] = low, high
    pose = {name: min(max(present_rad[name], bounds[name][0]), bounds[name][1]) for name in JOINT_NAMES}
    lacking_rad = rig.minimum_vergence_rad + reach_rad - (pose["pan_right"] - pose["pan_left"])
    if lacking_rad > 0:
        # half from each eye, the rest from the one that still can
        right = min(pose["pan_right"] + 0.5 * lacking_rad, bounds["pan_right"][1])
        left = max(right - rig.minimum_vergence_rad - reach_rad, bounds["pan_left"][0])
        left = min(left, pose["pan_left"])
        right = min(max(right, left + rig.minimum_vergence_rad + reach_rad), bounds["pan_right"][1])
        if right - left < rig.minimum_vergence_rad + amplitude_rad:
            raise IdentifyError(
                f"the pans' limits must leave room for moves of {amplitude_rad:.3f} rad (--amplitude-deg) beyond "
                f"minimum_vergence_rad, {rig.minimum_vergence_rad:g}"
            )
        pose |= {"pan_left": left, "pan_right": right}
    return pose
