"""Whether eyes and head were at rest around a pair's exposures: images of two moments are no stereo pair."""

import math

import numpy as np
import numpy.typing as npt

from vergence_metric.eye_rotation.parameters import RestParameters
from vergence_metric.pairs.frame_motion import frame_motion_px
from vergence_rig.joint_history import JointHistory

Pixels = npt.NDArray[np.uint8]

_SAMPLES = 8
_MIN_SKEW_S = 0.002


def joints_moved(history: JointHistory, first_ns: int, last_ns: int, p: RestParameters) -> str:
    """Return how the joints moved from `settle_s` before the first exposure to the last one; empty if at rest."""
    begin_ns = first_ns - round(p.settle_s * 1e9)
    poses = [history.at(moment, moment) for moment in np.linspace(begin_ns, last_ns, _SAMPLES).astype(int).tolist()]
    if any(pose is None for pose in poses):
        return "joint_states do not yet cover rest.settle_s before the exposure"
    angles = np.array([(pose.pan_left_rad, pose.pan_right_rad, pose.tilt_rad) for pose in poses if pose is not None])
    moved_rad = float(np.ptp(angles, axis=0).max())
    return (
        "" if moved_rad <= p.max_joint_rad else f"not at rest: a joint moved by {math.degrees(moved_rad):.1f} degrees"
    )


def view_moved(before: Pixels, after: Pixels, interval_s: float, skew_s: float, p: RestParameters) -> str:
    """Return the motion from one grey left image to the next; empty if negligible over the pair's skew."""
    speed_px_s = frame_motion_px(before, after) / max(interval_s, 1e-3)
    moved_px = speed_px_s * max(abs(skew_s), _MIN_SKEW_S)
    return (
        ""
        if moved_px <= p.max_image_motion_px
        else f"not at rest: the left image moves by {speed_px_s:.0f} px a second"
    )
