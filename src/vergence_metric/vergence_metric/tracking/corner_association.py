"""Which corners of the next image are which known corners: the nearest in its gate that looks alike takes each.

After Reid and Murray (1996): the filter of each corner says where to look and how far. Before that all corners together
may be off, which they vote for.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vergence_metric.disparity.protocol import Image
from vergence_metric.tracking.affine_transfer import AffineCamera
from vergence_metric.tracking.common_motion import common_motion
from vergence_metric.tracking.corners import Patches, patches_at
from vergence_metric.tracking.eye_view import EyeView, Points
from vergence_metric.tracking.known_corners import KnownCorners

_ALIKE = 0.8  # least correlation of the same corner in successive images
_LEAST_GATE_PX, _SIGMAS = 2.5, 3.0


@dataclass(frozen=True)
class MatchedCorners:
    """Corners `known` (M,) that are seen at `px` (M, 2) with what they look like, off by `common_px` together.

    `found` (N, 2) are all corners of the image that were compared.
    """

    known: NDArray[np.intp]
    px: Points
    patches: Patches
    common_px: float
    found: Points


def match_corners(
    image: Image,
    view: EyeView,
    found: Points,
    corners: KnownCorners,
    camera: AffineCamera,
    expected_px: Points,
    reach_px: float,
    hidden: bool,
) -> MatchedCorners:
    """Return which known corners are among those found (N, 2) in an image (h, w).

    Args:
        image: of the left eye.
        view: of that eye.
        found: corners of the image.
        corners: known ones.
        camera: where the eye saw them last.
        expected_px: where the structure's origin is predicted (2,).
        reach_px: by which all together may be off.
        hidden: no corner was seen in the last image.

    """
    patches = patches_at(image, found)
    shown = camera.project(corners.structure.points) - camera.origin_px + expected_px
    followed = (corners.misses == 0) & (not hidden)
    shown[followed] = view.pixels(corners.filters.angles[followed])
    alike = corners.patches @ patches.T >= _ALIKE
    across, down = (found[:, axis] - shown[:, axis, None] for axis in (0, 1))
    votes = alike & corners.established[:, None]
    common = common_motion(np.column_stack([across[votes], down[votes]]), reach_px)
    away = np.hypot(across - common[0], down - common[1])
    sigmas_px = _SIGMAS * corners.filters.sigma_rad * view.camera.fx_px
    gates = np.where(followed, np.clip(sigmas_px, _LEAST_GATE_PX, reach_px), 2.0 * _LEAST_GATE_PX)
    away[~alike | (away > gates[:, None])] = np.inf
    nearest = away.argmin(axis=1)
    # Of two that take the same corner the nearer one has it.
    mine = np.isfinite(away.min(axis=1)) & (away.argmin(axis=0)[nearest] == np.arange(len(corners)))
    known = np.flatnonzero(mine)
    chosen = nearest[known]
    return MatchedCorners(known, found[chosen], patches[chosen], float(np.hypot(*common)), found)
