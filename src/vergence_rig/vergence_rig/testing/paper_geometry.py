"""The paper's planar fixation geometry, a reference for `vergence_rig.geometry`."""

import math
from dataclasses import dataclass

from vergence_rig.geometry import GeometryError, check_converging


@dataclass(frozen=True)
class PaperFixation:
    """The paper's planar fixation point: `om_m` from the baseline's middle M, `x_m` forward, `y_m` left [m]."""

    om_m: float
    x_m: float
    y_m: float
    vergence_rad: float


def paper_fixation(c1_rad: float, c2_rad: float, baseline_m: float) -> PaperFixation:
    """Return the fixation point from the paper's baseline angles [rad].

    C1 and C2 are the interior angles of the triangle of both eyes and the fixation point: C1 = 90 deg + pan_left,
    C2 = 90 deg - pan_right. At equal angles OM = d/2 tan C. Raises ParallelAxesError or DivergingAxesError.
    """
    for name, angle in (("c1_rad", c1_rad), ("c2_rad", c2_rad)):
        if not 0.0 < angle < math.pi:
            raise GeometryError(f"{name} must be an angle between 0 and pi [rad]: got {angle!r}")
    vergence_rad = math.pi - c1_rad - c2_rad
    check_converging(vergence_rad)
    forward = baseline_m * math.sin(c1_rad) * math.sin(c2_rad) / math.sin(c1_rad + c2_rad)
    lateral = 0.5 * baseline_m - forward * math.cos(c1_rad) / math.sin(c1_rad)
    return PaperFixation(math.hypot(forward, lateral), forward, lateral, vergence_rad)
