"""`vergence fixation`: the paper's planar case by number, from the angles C1 and C2 and the baseline."""

import argparse
import json
import math

from vergence_rig.paper_fixation import paper_fixation
from vergence_rig.rig import default_rig


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of the subcommand."""
    degrees = "interior angle of the triangle at the {} eye, in degrees; 90 looks straight ahead"
    parser.add_argument("--c1", type=float, required=True, help=degrees.format("left"))
    parser.add_argument("--c2", type=float, required=True, help=degrees.format("right"))
    baseline_m = default_rig().baseline_m
    parser.add_argument("--baseline", type=float, default=baseline_m, help="in m (default %(default)s)")
    parser.add_argument("--json", action="store_true", help="print one JSON object")


def run(options: argparse.Namespace) -> int:
    """Print where the optical axes meet; 0. Raises GeometryError where they do not."""
    found = paper_fixation(math.radians(options.c1), math.radians(options.c2), options.baseline)
    values = {
        "c1_deg": options.c1,
        "c2_deg": options.c2,
        "baseline_m": options.baseline,
        "om_m": found.om_m,
        "c1m_m": found.c1m_m,
        "distance_m": found.distance_m,
        "vergence_deg": math.degrees(found.vergence_rad),
        "pan_left_deg": options.c1 - 90.0,
        "pan_right_deg": 90.0 - options.c2,
    }
    if options.json:
        print(json.dumps(values))
        return 0
    print(
        f"OM   {found.om_m:.6f} m   fixation point O above the baseline\n"
        f"C1M  {found.c1m_m:.6f} m   from the left eye along the baseline to M, the foot of O\n"
        f"from the baseline's middle {found.distance_m:.6f} m\n"
        f"vergence {values['vergence_deg']:.3f} deg, pan_left {values['pan_left_deg']:+.3f} deg, "
        f"pan_right {values['pan_right_deg']:+.3f} deg"
    )
    return 0
