"""Whether eyes and head stood still about a pair's exposures: two moments of a moving eye are no stereo pair."""

import math

import numpy as np
import numpy.typing as npt

from vergence_metric.eye_rotation.parameters import EncoderParameters
from vergence_metric.pairs.image_motion import image_motion_px
from vergence_metric.pairs.joint_history import JointHistory

Pixels = npt.NDArray[np.uint8]

_LOOKS = 8
_LEAST_SKEW_S = 0.002


def joints_moved(history: JointHistory, first_ns: int, last_ns: int, p: EncoderParameters) -> str:
    """Return how the joints moved from `settle_s` before the first exposure to the last one; empty if they rested."""
    begin_ns = first_ns - round(p.settle_s * 1e9)
    poses = [history.at(moment, moment) for moment in np.linspace(begin_ns, last_ns, _LOOKS).astype(int).tolist()]
    if any(pose is None for pose in poses):
        return "joint_states do not reach back far enough yet"
    angles = np.array([(pose.pan_left_rad, pose.pan_right_rad, pose.tilt_rad) for pose in poses if pose is not None])
    moved_rad = float(np.ptp(angles, axis=0).max())
    return "" if moved_rad <= p.still_rad else f"a joint turned by {math.degrees(moved_rad):.1f} degrees"


def view_moved(before: Pixels, after: Pixels, interval_s: float, skew_s: float, p: EncoderParameters) -> str:
    """Return how the view moves from one grey left image to the next; empty if it rests for the pair's skew."""
    speed_px_s = image_motion_px(before, after) / max(interval_s, 1e-3)
    moved_px = speed_px_s * max(abs(skew_s), _LEAST_SKEW_S)
    return "" if moved_px <= p.most_motion_px else f"the view moves by {speed_px_s:.0f} px a second"
