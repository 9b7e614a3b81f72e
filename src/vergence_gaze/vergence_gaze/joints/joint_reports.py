"""Reports of the joints as angles of the eyes."""

from vergence_gaze.estimation.observations import JointReport
from vergence_rig.rig import JOINT_NAMES, Rig


def in_eye_angles(report: JointReport, rig: Rig) -> JointReport:
    """Return a report of joints as one of eye angles: zeros, scales and yaws of the rig applied; other names kept."""
    positions = {
        name: rig.eye_angle(name, rad) if name in JOINT_NAMES else rad for name, rad in report.positions_rad.items()
    }
    return JointReport(report.stamp_s, positions)
