"""What `vergence identify` found of printed heads, read from files."""

import os
from functools import lru_cache
from pathlib import Path

from vergence_rig.rig import Rig
from vergence_rig.rig_file import load_rig

FOUND_FOLDER = "VERGENCE_GEOMETRY_FOUND"
"""The environment variable that names the folder of head_SEED.yaml, the rigs that were found."""


@lru_cache(maxsize=4)
def found_rig(seed: int) -> Rig:
    """Return the rig that was found of a printed head. Raises RigError where there is no file."""
    return load_rig(Path(os.environ.get(FOUND_FOLDER, ".")) / f"head_{seed}.yaml")
