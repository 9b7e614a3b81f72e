"""Printed heads as `vergence identify` finds them, kept in files for the clicks that follow in other processes."""

from functools import lru_cache

import cv2

from bench.geometry_identify import identified
from bench.results import OUT_DIR
from vergence_calibration.geometry.identify_geometry import FoundGeometry
from vergence_rig.rig import Rig
from vergence_rig.rig_file import load_rig, write_rig

FOLDER = OUT_DIR / "geometry_heads"


def identify_head(seed: int) -> tuple[FoundGeometry, Rig, float]:
    """Identify the printed head of a seed, keep the rig that is found, and return what `identified` does."""
    cv2.setNumThreads(1)
    result = identified(seed)
    write_rig(FOLDER / f"head_{seed}.yaml", result[0].rig)
    return result


@lru_cache(maxsize=4)
def found_rig(seed: int) -> Rig:
    """Return the rig that was found of a printed head. Raises RigError where it was not identified yet."""
    return load_rig(FOLDER / f"head_{seed}.yaml")
