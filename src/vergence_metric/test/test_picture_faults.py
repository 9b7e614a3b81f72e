"""Frozen, identical, black and white pictures are named; live ones, and a simulator's without noise, are not."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from vergence_metric.pairs.picture_faults import PictureFault, PictureMonitor

Pixels = npt.NDArray[np.uint8]
INTERVAL_S = 1 / 30
RNG = np.random.default_rng(0)
WALL = np.clip(RNG.normal(120, 40, (120, 1)) + np.linspace(-60, 60, 260) + 20 * np.sin(np.arange(260) / 7), 0, 255)


def scene(shift_px: float = 0.0, noise: float = 2.0) -> Pixels:
    """A wall, seen `shift_px` (not always whole) further to the left, (120, 160, 3) BGR."""
    columns = 20 + shift_px + np.arange(160)
    rows = [np.interp(columns, np.arange(260), row) for row in WALL]
    image = np.array(rows)[:, :, None] + noise * RNG.normal(size=(120, 160, 3))
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


class Eyes:
    """Pairs at 30 Hz into one monitor."""

    def __init__(self) -> None:
        self.monitor, self._stamp_s = PictureMonitor(), 1.7e9

    def show(self, left: Pixels, right: Pixels) -> PictureFault | None:
        self._stamp_s += INTERVAL_S
        return self.monitor.update(self._stamp_s, left, right)

    def live(self, pairs: int = 30, **fields: Any) -> list[PictureFault | None]:
        return [self.show(scene(0.0, **fields), scene(8.0, **fields)) for _ in range(pairs)]


def faults(eyes: Eyes, pictures: Iterator[tuple[Pixels, Pixels]], pairs: int = 20) -> list[PictureFault | None]:
    return [eyes.show(*next(pictures)) for _ in range(pairs)]


def test_live_pictures_have_no_fault() -> None:
    assert not any(Eyes().live(60))
    assert not any(Eyes().live(60, noise=0.6))


@pytest.mark.parametrize(("frozen", "names"), [((1, 1), ["left", "right"]), ((1, 0), ["left"]), ((0, 1), ["right"])])
def test_frozen_pictures_are_named_after_half_a_second_and_recover(frozen: Any, names: list[str]) -> None:
    eyes = Eyes()
    eyes.live()
    held = scene(0.0), scene(8.0)

    def pictures() -> Iterator[tuple[Pixels, Pixels]]:
        while True:
            yield held[0] if frozen[0] else scene(0.0), held[1] if frozen[1] else scene(8.0)

    seen = faults(eyes, pictures())
    assert not any(seen[:15])
    fault = seen[-1]
    assert fault is not None
    assert fault.unusable
    for name in ("left", "right"):
        assert (f"the {name} image is frozen" in fault.reason) == (name in names)
    assert not any(eyes.live(5))


@pytest.mark.parametrize("speed_px", [0.0, 0.1, 1.0, 7.0])
def test_a_simulator_without_noise_that_comes_to_rest_is_not_frozen(speed_px: float) -> None:
    eyes = Eyes()
    seen = [eyes.show(scene(speed_px * i, 0.0), scene(8.0 + speed_px * i, 0.0)) for i in range(12)]
    seen += [eyes.show(scene(speed_px * i, 0.0), scene(8.0 + speed_px * i, 0.0)) for i in range(12, 0, -1)]
    assert not any([*seen, *eyes.live(40, noise=0.0)])


def test_a_target_that_moves_before_noisy_cameras_does_not_hide_that_they_freeze() -> None:
    eyes = Eyes()
    for i in range(40):
        eyes.show(scene(0.3 * i if i < 20 else 0.0), scene(8.0))
    held = scene(0.0), scene(8.0)
    assert [eyes.show(*held) for _ in range(20)][-1] is not None


@pytest.mark.parametrize("apart", [0, 1])
def test_one_camera_that_feeds_both_eyes_is_named(apart: int) -> None:
    eyes, before = Eyes(), scene(0.0)
    seen = []
    for i in range(25):
        now = scene(0.2 * i)
        seen.append(eyes.show(now, before if apart else now))
        before = now
    assert not any(seen[:14])
    assert seen[-1] == PictureFault("both eyes show the same picture: one camera feeds both", True)


@pytest.mark.parametrize(("level", "text"), [(2, "is black"), (253, "is white (saturated)")])
def test_black_and_white_pictures_are_named(level: int, text: str) -> None:
    def flat() -> Pixels:
        return np.clip(level + RNG.normal(0.0, 1.0, (120, 160, 3)), 0, 255).astype(np.uint8)

    eyes = Eyes()
    eyes.live()
    both = [eyes.show(flat(), flat()) for _ in range(20)][-1]
    assert both == PictureFault(f"the left image {text}; the right image {text}", True)
    one = [eyes.show(scene(0.0), flat()) for _ in range(20)][-1]
    assert one == PictureFault(f"the right image {text}", False)


def test_other_sizes_and_stamps_that_run_back_start_again() -> None:
    eyes = Eyes()
    eyes.live()
    held = scene(0.0), scene(8.0)
    for _ in range(14):
        eyes.show(*held)
    assert eyes.monitor.update(5.0, *held) is None
    assert eyes.monitor.update(6.0, held[0][::2], held[1][::2, :, 0]) is None


def test_a_blank_wall_is_not_one_camera() -> None:
    eyes, blank = Eyes(), np.full((120, 160), 90, np.uint8)
    assert not any(eyes.show(blank, blank) for _ in range(30))
