"""Renders on disk: one file per world, images as the detector gets them at run time, boxes in their pixels."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vergence_metric.boxes.letterbox import Letterbox

INPUT_PX = (320, 240)
MOST = 4


@dataclass(frozen=True)
class Shard:
    """One world's renders: `images` (n, 240, 320, 3) BGR, `boxes` (n, 4, 4) xyxy counted from the image's corner [px].

    `count` (n,) says how many boxes there are, `visible` (n, 4) what share of each is seen, `cut` (n, 4) which the
    border cuts.
    """

    images: NDArray[np.uint8]
    boxes: NDArray[np.float32]
    count: NDArray[np.int64]
    visible: NDArray[np.float32]
    cut: NDArray[np.bool_]


def shard_path(folder: Path, seed: int) -> Path:
    """Return where a world's renders are kept."""
    return folder / f"world_{seed:07d}.npz"


def render_world(seed: int, views: int, target_share: float) -> Shard:
    """Render one world."""
    from tools.train_detector.scenes import Stage

    stage = Stage(seed)
    try:
        images, boxes = np.empty((views, INPUT_PX[1], INPUT_PX[0], 3), np.uint8), np.zeros((views, MOST, 4), np.float32)
        count, visible = np.zeros(views, np.int64), np.zeros((views, MOST), np.float32)
        cut = np.zeros((views, MOST), bool)
        for i, view in enumerate(stage.views(views, target_share)):
            box = Letterbox.fit((view.image.shape[1], view.image.shape[0]), INPUT_PX)
            n = len(view.boxes_px)
            images[i], count[i], boxes[i, :n] = box.place(view.image), n, box.to_input(view.boxes_px)
            visible[i, :n], cut[i, :n] = view.visible, view.cut
    finally:
        stage.close()
    return Shard(images, boxes, count, visible, cut)


def make(folder: Path, seeds: range, views: int, say: Callable[[str], None], target_share: float = 0.75) -> None:
    """Render the worlds of `seeds` that are not there yet."""
    folder.mkdir(parents=True, exist_ok=True)
    for done, seed in enumerate(seeds):
        path = shard_path(folder, seed)
        if path.exists():
            continue
        shard = render_world(seed, views, target_share)
        part = path.with_suffix(".part")
        with part.open("wb") as file:
            np.savez(file, **vars(shard))
        part.rename(path)
        say(f"rendered {done + 1} of {len(seeds)} worlds, {(done + 1) * views} images")


def load(paths: list[Path]) -> Shard:
    """Return several worlds' renders as one."""
    parts = []
    for path in paths:
        with np.load(path) as file:
            parts.append({name: file[name] for name in file.files})
    return Shard(**{name: np.concatenate([part[name] for part in parts]) for name in parts[0]})
