"""Measurement of a pair on condition: cameras and joints known, eyes and head at rest around its exposures."""

from typing import Any

from vergence_metric.edges.edges import to_grey
from vergence_metric.eye_rotation.encoder import EyeRotationReading, EyeRotationStatus, VisualEncoder, not_measured
from vergence_metric.eye_rotation.parameters import RestParameters
from vergence_metric.eye_rotation.rest import joints_moved, view_moved
from vergence_metric.pairs.pairing import Pair
from vergence_rig.camera import CameraModel
from vergence_rig.joint_history import JointHistory


def measure_pair(
    encoder: VisualEncoder,
    rest: RestParameters,
    before: Pair[Any],
    pair: Pair[Any],
    joints: JointHistory,
    models: tuple[CameraModel, CameraModel] | None,
) -> EyeRotationReading:
    """Return the reading of a pair; the pair before it shows whether the image moves.

    Frames of the pairs have `pixels`, (h, w, 3) BGR or (h, w) grey uint8.
    """
    if models is None:
        return not_measured(EyeRotationStatus.NO_CAMERA_INFO, "no camera_info for images of this size yet")
    eyes = joints.at(pair.left_stamp_ns, pair.right_stamp_ns)
    if eyes is None:
        return not_measured(EyeRotationStatus.NO_JOINTS, joints.gap(max(pair.left_stamp_ns, pair.right_stamp_ns)))
    stamps = (pair.left_stamp_ns, pair.right_stamp_ns)
    moved = joints_moved(joints, min(stamps), max(stamps), rest)
    if not moved:
        interval_s = (pair.left_stamp_ns - before.left_stamp_ns) * 1e-9
        moved = view_moved(
            to_grey(before.left.pixels), to_grey(pair.left.pixels), interval_s, pair.skew_ns * 1e-9, rest
        )
    if moved:
        return not_measured(EyeRotationStatus.MOVING, moved, eyes)
    return encoder.measure(pair.left.pixels, pair.right.pixels, eyes, models)
