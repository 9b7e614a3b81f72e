"""A piece of one photograph that moves across another one, both seen by eyes that turn.

An eye that turns about its optical centre sees a photograph by a homography, and so it sees a piece that turns about
the same centre: every pixel's place is known. Each eye sees its own photograph of a pair, so that the piece has the
relief that it had, at the distance at which its middle is shown.
"""

from collections.abc import Iterator

import cv2
import numpy as np

from bench.photos_data import flattest, pair_names, pair_of
from bench.trackers_photographs import Image, photograph_rig, sensed, spread
from bench.trackers_scenes import FRAME_S, LAG_FRAMES, Array, Frame, Pixel, at_angle, reported_angles
from vergence_rig.geometry import EyeAngles
from vergence_rig.rig import Rig
from vergence_rig.testing.ideal_eyes import gaze_for_point
from vergence_sim.optics import Lens
from vergence_sim.photo.pair import PhotoPair, PhotoPoint
from vergence_sim.photo.views import PhotoEye

_PIECES, _PAIRS = 6, 36
_HALF_PX = 32.0  # half side of a piece, pixels of its photograph
_FROM_DEG, _SPEED_DEG_S, _REST_S = -9.0, 20.0, 0.3
_BACKGROUND_AFTER = 13  # of the pairs by name: the one so far behind a piece's own lies behind it
_FRACTION_BITS = 4  # of a pixel, for the outline


def moving_pieces(follow: bool, count: int = _PIECES) -> Iterator[tuple[str, list[Frame]]]:
    """Yield name and frames of pieces that rest, then move at 20 degrees a second.

    The eyes follow the piece two pairs late, or they stand still. Raises NoPhotographsError without photographs.
    """
    names = pair_names()
    for number, name in spread(count):
        behind = names[(names.index(name) + _BACKGROUND_AFTER) % len(names)]
        yield f"{name} over {behind}", list(_frames(_Piece(name), pair_of(behind), number, follow))


class _Piece:
    """A square of a pair of photographs about a point on a flat surface."""

    def __init__(self, name: str) -> None:
        self._pair = pair_of(name)
        point = flattest(name, _HALF_PX + 1.0)
        self._ahead = self._pair.fixation(point)
        corners = [(-_HALF_PX, -_HALF_PX), (_HALF_PX, -_HALF_PX), (_HALF_PX, _HALF_PX), (-_HALF_PX, _HALF_PX)]
        places = [(0.0, 0.0), *corners]
        rays = [self._pair.rays(PhotoPoint(point.x_px + x, point.y_px + y, point.disparity_px)) for x, y in places]
        self._rays = tuple(np.array([pair[eye] for pair in rays]) for eye in (0, 1))
        self._eyes = _photo_eyes(self._pair, photograph_rig())

    def paste(self, into: Image, eye: int, turned_rad: float) -> tuple[Image, Pixel, Array]:
        """Return a view (h, w, 3) with the piece before it, the pixel of its middle and its outline (4, 2).

        `turned_rad` is how far the eye, 0 for the left one, has turned beyond the piece's middle.
        """
        pan_rad = (self._ahead.pan_left_rad, self._ahead.pan_right_rad)[eye] + turned_rad
        shown, tilt_rad = self._eyes[eye], self._ahead.tilt_rad
        middle, *outline = (shown.project(ray, pan_rad, tilt_rad) for ray in self._rays[eye])
        mask = np.zeros(into.shape[:2], np.uint8)
        corners = np.rint(np.array(outline) * (1 << _FRACTION_BITS)).astype(np.int32)
        cv2.fillConvexPoly(mask, corners, 255, cv2.LINE_AA, _FRACTION_BITS)
        share = mask[:, :, None].astype(np.float32) / 255.0
        mixed = share * shown.view(pan_rad, tilt_rad) + (1.0 - share) * into
        return np.rint(mixed).astype(np.uint8), middle, np.array(outline)


def _photo_eyes(pair: PhotoPair, rig: Rig) -> tuple[PhotoEye, PhotoEye]:
    left, right, matrix = pair.seen_at(Lens(rig.left_camera).render_focal_px)
    ahead = np.eye(3)
    return (
        PhotoEye(left, matrix, Lens(rig.left_camera), ahead),
        PhotoEye(right, matrix, Lens(rig.right_camera), ahead),
    )


def _frames(piece: _Piece, background: PhotoPair, seed: int, follow: bool) -> Iterator[Frame]:
    rig, rng = photograph_rig(), np.random.default_rng(seed)
    behind = _photo_eyes(background, rig)
    points = [np.array(at_angle(_FROM_DEG + _SPEED_DEG_S * max(k * FRAME_S - _REST_S, 0.0))) for k in range(_PAIRS)]
    targets = [gaze_for_point(point, rig.baseline_m) for point in points]
    still = EyeAngles(*(0.5 * (a + b) for a, b in zip(_angles(targets[0]), _angles(targets[-1]), strict=True)))
    for k, (point, target) in enumerate(zip(points, targets, strict=True)):
        eyes, before = (targets[max(k - late, 0)] if follow else still for late in (LAG_FRAMES, LAG_FRAMES + 1))
        seen, places, outlines = [], [], []
        for eye, (pan_rad, aim_rad) in enumerate(zip(_angles(eyes)[:2], _angles(target)[:2], strict=True)):
            view, place, outline = piece.paste(behind[eye].view(pan_rad, eyes.tilt_rad), eye, pan_rad - aim_rad)
            seen.append(sensed(view, rng))
            places.append(place)
            outlines.append(outline)
        yield Frame(
            k * FRAME_S,
            seen[0][0],
            seen[1][0],
            (seen[0][1], seen[1][1]),
            reported_angles(eyes, before),
            places[0],
            places[1],
            point,
            outlines[0],
            True,
            False,
            eyes,
        )


def _angles(eyes: EyeAngles) -> tuple[float, float, float]:
    return eyes.pan_left_rad, eyes.pan_right_rad, eyes.tilt_rad
