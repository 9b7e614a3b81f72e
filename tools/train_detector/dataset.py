"""Renders on disk: one file per world, full-size images, boxes in their pixels."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

INPUT_PX = (320, 240)
SOURCE_PX = (640, 480)
MOST = 4
_MOST_ALIKES = 8


@dataclass(frozen=True)
class Shard:
    """Renders: `images`, n of (480, 640, 3) BGR, `boxes` (n, 4, 4) xyxy counted from the image's corner [px].

    `count` (n,) says how many boxes there are, `visible` (n, 4) what share of each is seen, `cut` (n, 4) which the
    border cuts, `alikes` (n, 8, 2) where look-alikes are, NaN for none.
    """

    images: Sequence[NDArray[np.uint8]]
    boxes: NDArray[np.float32]
    count: NDArray[np.int64]
    visible: NDArray[np.float32]
    cut: NDArray[np.bool_]
    alikes: NDArray[np.float32]


def shard_path(folder: Path, seed: int) -> Path:
    """Return where a world's renders are kept."""
    return folder / f"world_{seed:07d}.npz"


@dataclass(frozen=True)
class Content:
    """What renders hold: the share with a cube, of these the share with each further one, of puzzles in look-alikes."""

    targets: float
    more: float
    puzzles: float


TRAINING = Content(0.75, 0.5, 0.4)
"""Dense, for what a render costs, and rich in what is hard."""

HELD_OUT = Content(0.5, 0.15, 0.2)


def render_world(seed: int, views: int, content: Content) -> Shard:
    """Render one world."""
    from tools.train_detector.scenes import Stage

    stage = Stage(seed, puzzle_share=content.puzzles)
    try:
        images = np.empty((views, SOURCE_PX[1], SOURCE_PX[0], 3), np.uint8)
        boxes, alikes = np.zeros((views, MOST, 4), np.float32), np.full((views, _MOST_ALIKES, 2), np.nan, np.float32)
        count, visible = np.zeros(views, np.int64), np.zeros((views, MOST), np.float32)
        cut = np.zeros((views, MOST), bool)
        for i, view in enumerate(stage.views(views, content.targets, content.more)):
            n = len(view.boxes_px)
            images[i], count[i], boxes[i, :n] = view.image, n, view.boxes_px + 0.5
            visible[i, :n], cut[i, :n] = view.visible, view.cut
            alikes[i, : len(view.alike_px)] = view.alike_px + 0.5
    finally:
        stage.close()
    return Shard(list(images), boxes, count, visible, cut, alikes)


def make(folder: Path, seeds: range, views: int, content: Content, say: Callable[[str], None]) -> None:
    """Render the worlds of `seeds` that are not there yet."""
    folder.mkdir(parents=True, exist_ok=True)
    for done, seed in enumerate(seeds):
        path = shard_path(folder, seed)
        if path.exists():
            continue
        shard = render_world(seed, views, content)
        part = path.with_suffix(".part")
        with part.open("wb") as file:
            np.savez(file, **vars(shard))
        part.rename(path)
        say(f"rendered {done + 1} of {len(seeds)} worlds, {(done + 1) * views} images")


def load(paths: list[Path]) -> Shard:
    """Return several worlds' renders as one, all in memory: 55 MB for a world of 60 views."""
    parts = []
    for path in paths:
        with np.load(path) as file:
            parts.append({name: file[name] for name in file.files})
    images = [image for part in parts for image in part.pop("images")]
    return Shard(images=images, **{name: np.concatenate([part[name] for part in parts]) for name in parts[0]})
