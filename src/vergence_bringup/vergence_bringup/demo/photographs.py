"""The demo's photographs: read or borrowed from scikit-image, the points to click on, and what is known of each."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from vergence_bringup.demo.click_points import click_points
from vergence_bringup.demo.stations import Station
from vergence_bringup.figures.pictures import write_image
from vergence_rig.geometry import EyeAngles
from vergence_rig.install_hint import install_hint
from vergence_rig.regular_file import expanded
from vergence_rig.rig import Rig
from vergence_sim.photo.matching import matched_disparity
from vergence_sim.photo.pair import PhotoPair, PhotoPoint, read_pair
from vergence_sim.photo.parameters import PhotoParameters
from vergence_sim.photo.world import cropped

Array = npt.NDArray[np.float64]

CLICKS, SHORT_CLICKS = 6, 3
MEASURED, MATCHED, UNKNOWN = "structured light", "semi-global matching", "not known"
"""What the disparity of a point is from."""

_START_MARGIN_PX = 48.0
_LEAST_SIDE_PX = 120
_BORROW = (
    "--photos without paths shows scikit-image's stereo pair, which is not here ({}): install it ({}), "
    "or give the paths of both photographs of a rectified pair, LEFT RIGHT"
)


@dataclass(frozen=True)
class PhotoFigures:
    """Where the eyes came to rest on the photographs.

    Attributes:
        point: what was clicked, with its disparity, NaN where it is not known.
        source: what the disparity is from: MEASURED, MATCHED or UNKNOWN.
        rests_px: the pixels (x, y), (x, y) of the left and the right photograph on the eyes' true pan directions.
    """

    point: PhotoPoint
    source: str
    rests_px: tuple[tuple[float, float], tuple[float, float]]

    @property
    def verged_disparity_px(self) -> float:
        """The disparity on which the eyes came to rest."""
        return self.rests_px[0][0] - self.rests_px[1][0]


class Photographs:
    """A pair with its points, in the order in which they are clicked on; `disparity` (h, w) [px] is NaN if unknown."""

    def __init__(
        self, paths: tuple[Path, Path], pair: PhotoPair, disparity: Array, source: str, count: int = CLICKS
    ) -> None:
        self.paths, self.pair, self.source = paths, pair, source
        self.points = [_point(x, y, disparity) for x, y in click_points(pair.left, count)]
        if not self.points:
            raise ValueError("the left photograph must have texture somewhere: nothing in it can be recognised")

    @property
    def parameters(self) -> dict[str, object]:
        """Photo_node's parameters."""
        values: dict[str, object] = {"left": str(self.paths[0]), "right": str(self.paths[1])}
        known = [value for p in self._numbered if p.depth_known for value in (p.x_px, p.y_px, p.disparity_px)]
        rays = [value for p in self._numbered if not p.depth_known for value in (p.x_px, p.y_px)]
        # Only lists with something in them: an empty one has no type on a command line.
        return values | {name: value for name, value in (("points_px", known), ("rays_px", rays)) if value}

    def stations(self, rig: Rig) -> list[Station]:
        """Return one station a point: the eyes begin parallel, where they see it."""
        shown = PhotoParameters(left="", right="")
        camera = cropped(rig, shown.view_width_px, shown.view_height_px).left_camera
        stations = []
        for number, point in enumerate(self.points, 1):
            start = self.pair.start_towards(point, camera, _START_MARGIN_PX)
            known = f"{point.disparity_px:.1f} px, by {self.source}" if point.depth_known else UNKNOWN
            stations.append(
                Station(
                    f"point_{number}",
                    f"A click at ({point.x_px:.0f}, {point.y_px:.0f}) px of the left photograph; disparity: {known}",
                    f"point {self.number_of(point)}",
                    None,
                    start_version_deg=math.degrees(start.version_rad),
                    start_vergence_deg=0.0,
                    start_tilt_deg=math.degrees(start.tilt_rad),
                )
            )
        return stations

    def point_of(self, station: Station) -> PhotoPoint:
        """Return the point of a station."""
        return self._numbered[int(station.target.removeprefix("point "))]

    def number_of(self, point: PhotoPoint) -> int:
        """Return the number by which photo_node knows a point."""
        return self._numbered.index(point)

    def figures(self, station: Station, resting: EyeAngles) -> PhotoFigures:
        """Return what the true angles at rest say of a station's point."""
        point = self.point_of(station)
        return PhotoFigures(point, self.source if point.depth_known else UNKNOWN, self.pair.on_axes(resting))

    def as_json(self) -> dict[str, Any]:
        """Return what summary.json says of the photographs."""
        return {
            "left": str(self.paths[0]),
            "right": str(self.paths[1]),
            "size_px": [self.pair.width_px, self.pair.height_px],
            "assumed_focal_px": round(self.pair.fx_px, 1),
            "disparities_from": self.source,
        }

    @property
    def _numbered(self) -> list[PhotoPoint]:
        """The points in photo_node's order: those of known depth first."""
        return sorted(self.points, key=lambda point: not point.depth_known)


def open_photographs(given: Sequence[str], out_dir: Path, count: int = CLICKS) -> Photographs:
    """Return the photographs of two paths, or scikit-image's pair, written to `out_dir`, where none is given.

    Raises ValueError, which says what must be given, where there is no such pair.
    """
    if not given:
        return _borrowed(out_dir / "photographs", count)
    if len(given) != 2:
        raise ValueError(
            f"--photos must be followed by two paths, LEFT RIGHT, or by none: got {len(given)} ({' '.join(given)})"
        )
    left, right = map(expanded, given)
    pair = read_pair(left, right)
    if min(pair.width_px, pair.height_px) < _LEAST_SIDE_PX:
        raise ValueError(
            f"the photographs must be at least {_LEAST_SIDE_PX} px wide and high: got "
            f"{pair.width_px}x{pair.height_px} px"
        )
    paths = left.resolve(), right.resolve()
    return Photographs(paths, pair, matched_disparity(pair.left, pair.right), MATCHED, count)


def _borrowed(folder: Path, count: int) -> Photographs:
    try:
        from skimage.data import stereo_motorcycle

        left, right, disparity = stereo_motorcycle()
    except (ImportError, OSError) as error:
        raise ValueError(_BORROW.format(str(error).splitlines()[0], install_hint("scikit-image"))) from error
    paths = (folder / "left.png").resolve(), (folder / "right.png").resolve()
    for path, image in zip(paths, (left, right), strict=True):
        write_image(path, np.ascontiguousarray(image[:, :, ::-1]))
    known = np.where(np.isfinite(disparity), disparity, np.nan).astype(np.float64)
    return Photographs(paths, read_pair(*paths), known, MEASURED, count)


def _point(x: int, y: int, disparity: Array) -> PhotoPoint:
    """Return a point with its disparity, where that puts it into the right photograph."""
    value = float(disparity[y, x])
    inside = math.isfinite(value) and 0.0 <= x - value <= disparity.shape[1] - 1
    return PhotoPoint(float(x), float(y), value if inside else math.nan)
