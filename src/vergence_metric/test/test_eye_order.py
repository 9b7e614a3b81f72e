"""Eyes that are exchanged, mirrored, upside down or blind are named; right ones, whatever they see, are not."""

import math
from collections.abc import Callable

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from vergence_metric.pairs.eye_order import EyeOrderMonitor

Pixels = npt.NDArray[np.uint8]
FOCAL_PX = 539.0
RNG = np.random.default_rng(5)
WALL = cv2.resize(RNG.integers(0, 256, (60, 120), dtype=np.uint8), (1440, 480), interpolation=cv2.INTER_CUBIC)


def pair(vergence_rad: float, needed_rad: float) -> tuple[Pixels, Pixels]:
    """What eyes of this vergence see of a wall that needs `needed_rad`, with noise."""
    shift_px = FOCAL_PX * math.tan(vergence_rad - needed_rad)
    images = []
    for eye in (-1, 1):
        at = np.array([[1, 0, 320 + 0.5 * eye * -shift_px], [0, 1, 0]], np.float32)
        view = cv2.warpAffine(WALL, at, (640, 480), flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)
        images.append(np.clip(view + RNG.normal(0, 2, view.shape), 0, 255).astype(np.uint8))
    return images[0], images[1]


def said(change: Callable[[Pixels, Pixels], tuple[Pixels, Pixels]], vergences_deg: list[float], needed: float) -> str:
    """Return what is said after half a second at each vergence."""
    monitor, stamp_s, text = EyeOrderMonitor(), 100.0, ""
    for vergence_deg in vergences_deg:
        for _ in range(7):
            stamp_s += 0.1
            vergence_rad = math.radians(vergence_deg)
            text = monitor.update(stamp_s, *change(*pair(vergence_rad, math.radians(needed))), vergence_rad, FOCAL_PX)
    return text


def as_they_are(left: Pixels, right: Pixels) -> tuple[Pixels, Pixels]:
    return left, right


def exchanged(left: Pixels, right: Pixels) -> tuple[Pixels, Pixels]:
    return right, left


@pytest.mark.parametrize("needed_deg", [-0.5, 0.0, 1.0, 4.0, 8.0])
@pytest.mark.parametrize("vergences_deg", [[0.0], [6.0], [0.0, 3.0, 6.0, 1.0]])
def test_right_eyes_are_not_accused(needed_deg: float, vergences_deg: list[float]) -> None:
    assert said(as_they_are, vergences_deg, needed_deg) == ""


def test_eyes_that_follow_what_they_see_are_not_accused() -> None:
    monitor, stamp_s = EyeOrderMonitor(), 100.0
    for vergence_deg in (1.0, 3.0, 6.0, 9.0, 2.0):
        for _ in range(7):
            stamp_s += 0.1
            angle = math.radians(vergence_deg)
            assert monitor.update(stamp_s, *pair(angle, angle), angle, FOCAL_PX) == ""


def test_exchanged_images_lie_behind_the_head() -> None:
    assert (
        "swapped, or the zeros of the pan joints are off: what both show would lie behind the head (vergence -4"
        in said(exchanged, [0.0], 4.0)
    )


def test_exchanged_images_move_twice_as_far_as_the_eyes_turn() -> None:
    assert "swapped: what both show moves by twice the angle" in said(exchanged, [2.0, 4.0, 6.0], 1.0)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda left, right: (left, cv2.flip(right, 1)), "mirrored (left and right exchanged)"),
        (lambda left, right: (cv2.flip(left, 0), right), "upside down (mirrored top to bottom)"),
        (lambda left, right: (left, cv2.flip(right, -1)), "upside down (turned by half a turn)"),
        (
            lambda left, right: (left, RNG.integers(0, 256, right.shape, dtype=np.uint8)),
            "the right image shows nothing",
        ),
        (lambda left, right: (RNG.integers(0, 256, (*left.shape, 3), dtype=np.uint8), right), "the left image shows"),
    ],
)
def test_one_wrong_eye_is_named(change: Callable[[Pixels, Pixels], tuple[Pixels, Pixels]], words: str) -> None:
    assert words in said(change, [2.0], 3.0)


def test_without_joints_and_cameras_the_pictures_alone_are_compared() -> None:
    monitor = EyeOrderMonitor()
    for i in range(10):
        left, right = pair(0.0, 0.05)
        text = monitor.update(100 + 0.1 * i, left, cv2.flip(right, 1))
    assert "mirrored" in text


@pytest.mark.parametrize("level", [0, 128, 255])
def test_pictures_of_nothing_say_nothing(level: int) -> None:
    monitor = EyeOrderMonitor()
    flat = np.full((480, 640, 3), level, np.uint8)
    assert all(monitor.update(0.1 * i, flat, flat, 0.0, FOCAL_PX) == "" for i in range(20))
