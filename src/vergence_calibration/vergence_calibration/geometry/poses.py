"""The poses from which a head's geometry can be seen: pans together and apart, tilts, all within the joints' limits.

Version, tilt and vergence each sweep to and fro with a period of their own. So each joint arrives at the same angles
from below and from above, and its play differs from its zero and its scale.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vergence_calibration.geometry.views import Poses
from vergence_calibration.identification.axis_log import IdentifyError
from vergence_rig.parameters import Parameters, parameter
from vergence_rig.rig import JOINT_NAMES, Rig

_DEG = math.pi / 180.0
_MARGIN_RAD = 0.5 * _DEG
_PERIODS = (12, 10, 8)  # poses in one sweep to and fro of version, vergence and tilt
_LEAST_PAN_DEG, _LEAST_TILT_DEG, _LEAST_VERGENCE_DEG = 8.0, 5.0, 4.0


@dataclass(frozen=True)
class PoseParameters(Parameters):
    """How far and how often the head turns for its geometry."""

    poses: int = parameter(36, "number of poses", minimum=24, maximum=200)
    pan_deg: float = parameter(42.0, "largest version, to either side", unit="degrees", minimum=10, maximum=60)
    tilt_deg: float = parameter(18.0, "largest tilt, up and down", unit="degrees", minimum=5, maximum=45)
    vergence_deg: float = parameter(18.0, "largest vergence", unit="degrees", minimum=5, maximum=40)


def planned_poses(rig: Rig, parameters: PoseParameters) -> list[dict[str, float]]:
    """Return joint angles [rad] by name, in the order in which they are visited; one more than `parameters.poses`.

    The first pose only settles from which side the joints arrive at the second one.

    Raises:
        IdentifyError: limits too close together.
    """
    lower = rig.eye_angles([joint.lower_rad for _, joint in rig.joints.items()])
    upper = rig.eye_angles([joint.upper_rad for _, joint in rig.joints.items()])
    left, right, tilt = ((low + _MARGIN_RAD, high - _MARGIN_RAD) for low, high in zip(lower, upper, strict=True))
    nearest = max(rig.minimum_vergence_rad, right[0] - left[1], 0.0)
    vergence = nearest, min(nearest + parameters.vergence_deg * _DEG, right[1] - left[0])
    # Both pans stay within their limits at every version and vergence.
    version = _swept(
        max(left[0] + 0.5 * vergence[1], right[0] - 0.5 * vergence[0]),
        min(left[1] + 0.5 * vergence[0], right[1] - 0.5 * vergence[1]),
        parameters.pan_deg,
    )
    tilt = _swept(*tilt, parameters.tilt_deg)
    for name, (low, high), least_deg in (
        ("version (the pans together)", version, 2 * _LEAST_PAN_DEG),
        ("vergence (the pans apart)", vergence, _LEAST_VERGENCE_DEG),
        ("tilt", tilt, 2 * _LEAST_TILT_DEG),
    ):
        if not high - low >= least_deg * _DEG:
            raise IdentifyError(
                f"the joints' limits must leave a {name} of {least_deg:g} degrees for the geometry: got "
                f"{(high - low) / _DEG:.1f}"
            )
    planned = []
    for k in range(-1, parameters.poses):
        v, g, t = (_between(ends, k / period) for ends, period in zip((version, vergence, tilt), _PERIODS, strict=True))
        joints = rig.joint_angles((v - 0.5 * g, v + 0.5 * g, t))
        planned.append(dict(zip(JOINT_NAMES, joints, strict=True)))
    return planned


def _swept(low: float, high: float, most_deg: float) -> tuple[float, float]:
    """Return a range within two limits, as near to 0 as it can be."""
    half = min(most_deg * _DEG, 0.5 * (high - low))
    middle = min(max(0.0, low + half), high - half)
    return middle - half, middle + half


def _between(ends: tuple[float, float], sweeps: float) -> float:
    """Return where a sweep to and fro is; it starts in the middle, upwards."""
    phase = (sweeps + 0.25) % 1.0
    share = 2.0 * phase if phase < 0.5 else 2.0 - 2.0 * phase
    return ends[0] + share * (ends[1] - ends[0])


def visited(rig: Rig, reported_rad: Sequence[Sequence[float]], before_rad: Sequence[float]) -> Poses:
    """Return the poses of reported joint angles (P, 3) in order, from the pose before the first one (3,)."""
    joints_rad = np.asarray(reported_rad, np.float64).reshape(-1, 3)
    moves = np.diff(np.vstack([np.asarray(before_rad, np.float64), joints_rad]), axis=0)
    play_rad = np.array([2.0 * joint.servo.half_play_rad for _, joint in rig.joints.items()])
    arrived = np.where(np.abs(moves) > 1.5 * play_rad, np.sign(moves), 0.0)
    for pose in range(1, len(arrived)):
        # A small move onwards keeps the gears where they were.
        onwards = (arrived[pose] == 0) & (np.sign(moves[pose]) * arrived[pose - 1] >= 0)
        arrived[pose][onwards] = arrived[pose - 1][onwards]
    return Poses(joints_rad, arrived)
