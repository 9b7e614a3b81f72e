"""The paper's planar fixation geometry: both eyes and the object O are the corners of a triangle.

C1 is the left eye and the angle there, C2 the right one: C1 = 90 deg + pan_left, C2 = 90 deg - pan_right. M is the foot
of O on the baseline C1C2, at the baseline's middle only where C1 = C2. Source: *Achieving Vergence for a Binocular
Vision System*. For heads with lenses off the axes see `vergence_rig.kinematics`.
"""

import math
from dataclasses import dataclass

from vergence_rig.geometry import GeometryError, check_converging


@dataclass(frozen=True)
class PaperFixation:
    """The fixation point O by the paper's lengths [m].

    Attributes:
        om_m: OM, the height of O above the baseline, straight ahead of it.
        c1m_m: C1M, from the left eye along the baseline to M; negative where O lies to the left of the left eye.
        distance_m: from the middle of the baseline to O; OM only where C1 = C2.
        y_m: O to the left of the baseline's middle.
        vergence_rad: the angle at O, 180 deg - C1 - C2.
    """

    om_m: float
    c1m_m: float
    distance_m: float
    y_m: float
    vergence_rad: float


def paper_fixation(c1_rad: float, c2_rad: float, baseline_m: float) -> PaperFixation:
    """Return the fixation point of the interior angles C1 and C2 [rad] over a baseline [m].

    OM = d sin C1 sin C2 / sin(C1 + C2) and C1M = d cos C1 sin C2 / sin(C1 + C2); at equal angles OM = d/2 tan C1.
    Raises GeometryError for an angle or a baseline that no triangle has, ParallelAxesError or DivergingAxesError.
    """
    for name, angle in (("C1", c1_rad), ("C2", c2_rad)):
        if not 0.0 < angle < math.pi:
            raise GeometryError(f"{name} must be more than 0 and less than 180 degrees: got {math.degrees(angle):g}")
    if not (baseline_m > 0.0 and math.isfinite(baseline_m)):
        raise GeometryError(f"the baseline must be more than 0 m: got {baseline_m:g}")
    vergence_rad = math.pi - c1_rad - c2_rad
    check_converging(vergence_rad)
    c1o_m = baseline_m * math.sin(c2_rad) / math.sin(c1_rad + c2_rad)
    om_m, c1m_m = c1o_m * math.sin(c1_rad), c1o_m * math.cos(c1_rad)
    y_m = 0.5 * baseline_m - c1m_m
    return PaperFixation(om_m, c1m_m, math.hypot(om_m, y_m), y_m, vergence_rad)
