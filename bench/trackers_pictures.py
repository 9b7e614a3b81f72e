"""Draws each tracker at work for docs/trackers.md: `python -m bench.trackers_pictures`."""

import math
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from bench.trackers_pasted import moving_pieces
from bench.trackers_photographs import photograph_rig
from bench.trackers_runs import model_of, run_tracker
from bench.trackers_scenes import SCENES, Frame, rig, sequence
from vergence_metric.disparity.cepstral import EchoWindow
from vergence_metric.tracking.anchored_cluster import AnchoredCluster
from vergence_metric.tracking.moving_target import MovingTarget
from vergence_metric.tracking.protocol import Tracker
from vergence_metric.tracking.zero_disparity_pursuit import ZeroDisparityPursuit
from vergence_rig.rig import Rig

Picture = NDArray[np.uint8]

PATH = Path(__file__).resolve().parent.parent / "docs" / "images" / "trackers.jpg"
_HALF_PX, _ZOOM = 75, 2
_WINDOW_PX, _REACH_PX = 96, 120
_SEEN, _KNOWN, _TRUE, _SAID, _REGION = (80, 255, 80), (0, 190, 255), (60, 60, 255), (255, 255, 255), (255, 160, 0)
_PANELS = (
    ("corner_cluster", "turning", 32, "corner_cluster, turned by 25 deg"),
    ("corner_cluster", "half_hidden", 60, "corner_cluster, half hidden"),
    ("remembered_patch", "20_deg_s", 40, "remembered_patch, 20 deg/s"),
    ("zero_disparity", "rest", 20, "zero_disparity, at rest"),
    ("moving_target", "20_deg_s", 40, "moving_target, 20 deg/s"),
)
_ON_PHOTOGRAPHS = ("corner_cluster", "remembered_patch", "moving_target")
_PIECE, _PIECE_FRAME = 4, 28  # of those that move across photographs


def main() -> None:
    """Write the picture."""
    by_name = {scene.name: scene for scene in SCENES}
    panels = []
    for kind, scene, number, title in _PANELS:
        frames = list(sequence(by_name[scene], "cube"))
        panels.append(_titled(_panel(kind, frames, frames[number], rig()), title))
        if scene == "rest":
            cepstrum = frames[number]
    panels.append(_titled(_cepstrum(cepstrum), "cepstrum: the echo at its disparity"))
    frames = [found for _, found in moving_pieces(follow=True)][_PIECE]
    for kind in _ON_PHOTOGRAPHS:
        picture = _panel(kind, frames, frames[_PIECE_FRAME], photograph_rig())
        panels.append(_titled(picture, f"{kind}, photographs, 20 deg/s"))
    rows = [np.hstack(panels[k : k + 3]) for k in range(0, len(panels), 3)]
    PATH.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(PATH), np.vstack(rows), [cv2.IMWRITE_JPEG_QUALITY, 88])


def _panel(kind: str, frames: list[Frame], shown: Frame, head: Rig) -> Picture:
    picture = shown.colours[0].copy()

    def draw(frame: Frame, tracker: Tracker) -> None:
        if frame is not shown:
            return
        model = model_of(tracker)
        if isinstance(model, AnchoredCluster):
            corners = model.corners
            for px, visible in zip(corners.px, corners.visible, strict=True):
                cv2.circle(picture, _at(px), 2, _SEEN if visible else _KNOWN, -1, cv2.LINE_AA)
        elif isinstance(model, ZeroDisparityPursuit):
            _tint(picture, model.region.mask, model.region.origin_px)
        elif isinstance(model, MovingTarget) and model.region is not None:
            height, width = picture.shape[:2]
            mask = cv2.resize(model.region.mask.astype(np.uint8), (width, height), interpolation=cv2.INTER_NEAREST)
            _tint(picture, mask.astype(bool), (0, 0))

    until = [frame for frame in frames if frame.stamp_s <= shown.stamp_s]
    run, _ = run_tracker(kind, until, head, draw)
    cv2.circle(picture, _at(shown.left_px), 6, _TRUE, 1, cv2.LINE_AA)
    said = run.left_px[-1]
    if math.isfinite(said[0]):
        cv2.drawMarker(picture, _at(said), _SAID, cv2.MARKER_CROSS, 9, 1, cv2.LINE_AA)
    x, y = _at(shown.left_px)
    return _zoomed(picture[y - _HALF_PX : y + _HALF_PX, x - _HALF_PX : x + _HALF_PX])


def _cepstrum(frame: Frame) -> Picture:
    """Return both windows above the heights of their echoes over the disparity."""
    right = np.roll(frame.right, -24, axis=1)  # as if the eyes converged too little
    window = EchoWindow((frame.left.astype(np.float32), right.astype(np.float32)), frame.left_px, _WINDOW_PX)
    heights, disparities = window.heights(_REACH_PX, 5).max(axis=0), np.arange(-_REACH_PX, _REACH_PX + 1)
    side = 2 * _HALF_PX * _ZOOM
    picture = np.full((side, side, 3), 255, np.uint8)
    x, y = _at(frame.left_px)
    windows = [image[y - 37 : y + 37, x - 37 : x + 37] for image in (frame.left, right)]
    shown = cv2.resize(np.hstack(windows), (side, side // 2), interpolation=cv2.INTER_NEAREST)
    picture[: side // 2] = shown[:, :, None]
    across = np.interp(disparities, (disparities[0], disparities[-1]), (8, side - 8))
    top = max(float(heights.max()), 1.0)
    down = side - 24 - np.clip(heights, 0.0, None) / top * (side / 2 - 40)
    cv2.polylines(
        picture, [np.rint(np.column_stack([across, down])).astype(np.int32)], False, (160, 60, 0), 1, cv2.LINE_AA
    )
    best = int(heights.argmax())
    cv2.putText(
        picture,
        f"{disparities[best]:+.0f} px",
        (min(int(across[best]) + 6, side - 70), int(down[best]) + 12),
        cv2.FONT_HERSHEY_SIMPLEX,
        0.45,
        (0, 0, 0),
        1,
        cv2.LINE_AA,
    )
    return picture


def _at(px: object) -> tuple[int, int]:
    x, y = np.asarray(px, np.float64).tolist()
    return round(x), round(y)


def _tint(picture: Picture, mask: NDArray[np.bool_], origin: tuple[int, int]) -> None:
    """Colour what a mask covers, whose top-left pixel is `origin`."""
    ys, xs = np.nonzero(mask)
    ys, xs = ys + origin[1], xs + origin[0]
    inside = (ys >= 0) & (ys < picture.shape[0]) & (xs >= 0) & (xs < picture.shape[1])
    ys, xs = ys[inside], xs[inside]
    picture[ys, xs] = (0.55 * picture[ys, xs] + 0.45 * np.array(_REGION)).astype(np.uint8)


def _zoomed(picture: Picture) -> Picture:
    return np.asarray(cv2.resize(picture, None, fx=_ZOOM, fy=_ZOOM, interpolation=cv2.INTER_CUBIC), np.uint8)


def _titled(picture: Picture, title: str) -> Picture:
    bar = np.full((24, picture.shape[1], 3), 32, np.uint8)
    cv2.putText(bar, title, (6, 17), cv2.FONT_HERSHEY_SIMPLEX, 0.45, (255, 255, 255), 1, cv2.LINE_AA)
    return np.vstack([bar, picture])


if __name__ == "__main__":
    main()
