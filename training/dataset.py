"""Renders on disk: one file per world, full-size images, boxes in their pixels."""

import zipfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from training.scenes import View

INPUT_PX = (320, 240)
SOURCE_PX = (640, 480)
MOST = 4
_MOST_ALIKES = 8


@dataclass(frozen=True)
class Shard:
    """Renders: `images`, n of (480, 640, 3) BGR, `boxes` (n, 4, 4) xyxy counted from the image's corner [px].

    `count` (n,) is the number of boxes, `visible` (n, 4) what share of each is seen, `cut` (n, 4) which the
    border cuts, `alikes` (n, 8, 4) about where look-alikes are, NaN for none.
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
    """Shares of renders with a cube, of these with each further one, and of puzzles among the look-alikes."""

    targets: float
    more: float
    puzzles: float


TRAINING = Content(0.75, 0.5, 0.4)
"""Many cubes and hard cases per render, because renders are expensive."""

HELD_OUT = Content(0.5, 0.15, 0.2)


def render_world(seed: int, views: int, content: Content) -> Shard:
    """Render one world of cubes turned any way and of look-alikes."""
    from training.scenes import Stage

    stage = Stage(seed, puzzle_share=content.puzzles)
    try:
        return _shard(stage.views(views, content.targets, content.more), views)
    finally:
        stage.close()


def render_head_world(seed: int, views: int) -> Shard:
    """Render one world as the simulated head sees its target."""
    from training.head_views import head_views

    return _shard(head_views(seed, views), views)


def _shard(views: "Iterator[View]", count: int) -> Shard:
    images = np.empty((count, SOURCE_PX[1], SOURCE_PX[0], 3), np.uint8)
    boxes, alikes = np.zeros((count, MOST, 4), np.float32), np.full((count, _MOST_ALIKES, 4), np.nan, np.float32)
    found, visible = np.zeros(count, np.int64), np.zeros((count, MOST), np.float32)
    cut = np.zeros((count, MOST), bool)
    for i, view in enumerate(views):
        n = len(view.boxes_px)
        images[i], found[i], boxes[i, :n] = view.image, n, view.boxes_px + 0.5
        visible[i, :n], cut[i, :n] = view.visible, view.cut
        alikes[i, : len(view.alike_px)] = view.alike_px + 0.5
    return Shard(list(images), boxes, found, visible, cut, alikes)


def make(folder: Path, seeds: range, render: Callable[[int], Shard], say: Callable[[str], None]) -> None:
    """Render the worlds of `seeds` that are not there yet."""
    folder.mkdir(parents=True, exist_ok=True)
    for done, seed in enumerate(seeds):
        path = shard_path(folder, seed)
        if path.exists():
            continue
        shard = render(seed)
        part = path.with_suffix(".part")
        with part.open("wb") as file:
            np.savez(file, **vars(shard))
        part.rename(path)
        say(f"{folder.name}: rendered {done + 1} of {len(seeds)} worlds, {len(shard.images)} images each")


def load(paths: list[Path]) -> Shard:
    """Return several worlds' renders as one; the images stay on disk, in the files' own bytes, until they are used."""
    images: list[NDArray[np.uint8]] = []
    parts = []
    for path in paths:
        images += list(_mapped(path, "images"))
        with np.load(path) as file:
            parts.append({name: file[name] for name in file.files if name != "images"})
    return Shard(images=images, **{name: np.concatenate([part[name] for part in parts]) for name in parts[0]})


def _mapped(path: Path, name: str) -> NDArray[np.uint8]:
    """Return an array of an uncompressed archive without reading it."""
    with zipfile.ZipFile(path) as archive, archive.open(f"{name}.npy") as member:
        version = np.lib.format.read_magic(member)
        read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, _, dtype = read(member)
        info, head = archive.getinfo(f"{name}.npy"), member.tell()
    with path.open("rb") as file:
        file.seek(info.header_offset + 26)  # of the local header: the lengths of the name and of what follows it
        lengths = np.frombuffer(file.read(4), "<u2")
    start = info.header_offset + 30 + int(lengths.sum()) + head
    return np.memmap(path, dtype, "r", start, shape)
