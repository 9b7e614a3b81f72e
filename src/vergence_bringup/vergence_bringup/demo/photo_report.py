"""What the demo's report says of photographs: what is shown, what is measured, and where the eyes came to rest."""

import html
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from vergence_bringup.demo.photographs import MATCHED, MEASURED, PhotoFigures
from vergence_bringup.demo.result import StationResult
from vergence_bringup.figures.pictures import Image, with_cross, with_ring, write_image
from vergence_sim.photo.pair import PhotoPair

_WIDTH_PX = 760
_DISPARITIES = {
    MEASURED: "The disparities of the clicked points were measured by structured light by those who made the pair.",
    MATCHED: (
        "The disparities of the clicked points are not measured: they come from semi-global matching of the two "
        "photographs (OpenCV's StereoSGBM, kept where both ways agree and no depth edge is near). On "
        "scikit-image's pair, whose truth is known, about 2 in 100 of these are wrong by more than 2 px (make bench "
        "ONLY=photos), so that a disagreement may be the matching's fault."
    ),
}


def write_overview(pair: PhotoPair, results: Sequence[StationResult], pictures: Path) -> None:
    """Write both photographs with the clicked points (rings) and where the eyes came to rest (crosses)."""
    scale = min(1.0, _WIDTH_PX / pair.width_px)
    for eye, photograph in (("left", pair.left), ("right", pair.right)):
        drawn = np.asarray(cv2.resize(photograph, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA), np.uint8)
        for result in results:
            if result.photo is not None:
                drawn = _with_point(drawn, eye, result.name, result.photo, scale)
        write_image(pictures / f"photographs_{eye}.jpg", drawn)


def introduction(photographs: Mapping[str, Any]) -> str:
    """Return what is shown and what is measured, as HTML; `photographs` is what summary.json says of them."""
    width, height = photographs["size_px"]
    left, right = html.escape(photographs["left"]), html.escape(photographs["right"])
    return (
        f"<p>Photographs: {left} and {right}, {width} by {height} px. Each eye's view is an exact warp of its "
        "photograph, whatever the depth; servos and the cameras' faults are simulated.</p>"
        "<p><b>Measured:</b> the eyes' true angles, which the simulated servos have; from them how far off the clicked "
        "ray the left eye rests, and the pixels of both photographs on which the eyes rest; the times from the goal to "
        "the first report of vergence and to the goal's result. Where the clicked point's disparity is known, the same "
        f"for the right eye, and the vergence error. {_DISPARITIES[photographs['disparities_from']]} Where none is "
        "known, only the left eye is judged.</p>"
        f"<p><b>Not measured:</b> distances. The photographs' focal length, {photographs['assumed_focal_px']:g} px, "
        "and the baseline are assumed; another one shows a projectively changed scene. Beyond a photograph's frame a "
        "view shows padding. No real camera or servo moved.</p>"
    )


def about(figures: PhotoFigures) -> str:
    """Return what the eyes came to rest on, as HTML; the station's title says what was clicked."""
    (left_x, left_y), (right_x, right_y) = figures.rests_px
    return (
        f"At the end the left eye rests on ({left_x:.1f}, {left_y:.1f}) px of its photograph, the right eye on "
        f"({right_x:.1f}, {right_y:.1f}) px of its own: a disparity of {figures.verged_disparity_px:.1f} px. In the "
        "pictures a ring marks the clicked point where its place is known, a cross and a square the fovea."
    )


def _with_point(picture: Image, eye: str, name: str, figures: PhotoFigures, scale: float) -> Image:
    point = figures.point
    clicked_x = point.x_px if eye == "left" else point.x_px - point.disparity_px
    rest = figures.rests_px[0 if eye == "left" else 1]
    if all(map(math.isfinite, rest)):
        picture = with_cross(picture, (scale * rest[0], scale * rest[1]))
    return with_ring(picture, (scale * clicked_x, scale * point.y_px), name)
