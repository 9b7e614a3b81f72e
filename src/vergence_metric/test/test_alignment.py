import math
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from vergence_metric.alignment.alignment import Aligner, Alignment
from vergence_metric.alignment.misalignment import estimate_misalignment
from vergence_metric.alignment.parameters import AlignmentParameters

Grey = NDArray[np.uint8]
CHESSBOARDS = Path(__file__).resolve().parents[4] / "shared" / "data" / "stereo_chessboard"


def picture(seed: int) -> NDArray[np.float32]:
    noise = cv2.GaussianBlur(np.random.default_rng(seed).normal(size=(800, 1000)), (0, 0), 5.0)
    return (120 + 40 * noise / noise.std()).astype(np.float32)


def pair(
    vertical_px: float, roll_deg: float, disparity_px: float = 25.0, seed: int = 0, noise: float = 3.0
) -> tuple[Grey, Grey]:
    """Return views of one picture, the right one turned clockwise about its centre and shifted."""
    rng, scene = np.random.default_rng(seed), picture(seed)

    def view(x: float, y: float, roll: float) -> Grey:
        cos, sin = math.cos(roll), math.sin(roll)
        picture_from_view = np.array(
            [[cos, sin, x - cos * 319.5 - sin * 239.5], [-sin, cos, y + sin * 319.5 - cos * 239.5]]
        )
        seen = cv2.warpAffine(scene, picture_from_view, (640, 480), flags=cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP)
        return np.clip(np.rint(seen + rng.normal(0, noise, seen.shape)), 0, 255).astype(np.uint8)

    return view(500.0, 400.0, 0.0), view(500.0 + disparity_px, 400.0 + vertical_px, math.radians(roll_deg))


def grey(path: Path) -> Grey:
    image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    assert image is not None, path
    return np.asarray(image, np.uint8)


def auto(**changes: object) -> Aligner:
    return Aligner(AlignmentParameters.from_mapping(changes))


@pytest.mark.parametrize("disparity_px", [-120.0, 0.0, 90.0])
@pytest.mark.parametrize(("vertical_px", "roll_deg"), [(0.0, 0.0), (2.5, 1.0), (-13.0, -0.5), (18.0, 3.0)])
def test_offset_and_roll_are_found_whatever_the_disparity(
    vertical_px: float, roll_deg: float, disparity_px: float
) -> None:
    found = auto().update(*pair(vertical_px, roll_deg, disparity_px))
    assert found.estimated
    assert not found.bounded
    assert found.vertical_px == pytest.approx(vertical_px, abs=0.15)
    assert math.degrees(found.roll_rad) == pytest.approx(roll_deg, abs=0.1)


def test_offset_and_roll_are_removed_and_the_centre_keeps_its_column() -> None:
    left, right = pair(-9.0, 1.5, disparity_px=0.0, noise=0.0)
    aligned = auto().update(left, right).apply(right)
    middle = (slice(120, 360), slice(160, 480))
    difference = left[middle].astype(float) - aligned[middle]
    assert np.abs(difference).mean() < 1.5
    again = estimate_misalignment(left, aligned, search_horizontal_px=50, search_vertical_px=20)
    assert again is not None
    assert again.vertical_px == pytest.approx(0.0, abs=0.1)
    assert again.roll_rad == pytest.approx(0.0, abs=1e-3)


def test_convergence_is_not_measured_as_roll() -> None:
    """Eyes turned inwards see keystones: the vertical offset grows with x times y and is zero on both axes."""
    left, right = pair(0.0, 0.0, 0.0)
    columns, rows = np.meshgrid(np.arange(640, dtype=np.float32), np.arange(480, dtype=np.float32))
    x, y = columns - 319.5, rows - 239.5
    keystone = cv2.remap(right, columns, (rows + 3e-4 * x * y + 0.03 * y).astype(np.float32), cv2.INTER_CUBIC)
    found = auto().update(left, keystone)
    assert found.vertical_px == pytest.approx(0.0, abs=0.2)
    assert math.degrees(found.roll_rad) == pytest.approx(0.0, abs=0.1)


def test_a_larger_estimate_is_clipped_and_marked_as_bounded() -> None:
    found = auto(max_vertical_px=5.0, max_roll_rad=math.radians(1.0)).update(*pair(6.5, 1.6))
    assert found.bounded
    assert found.vertical_px == 5.0
    assert found.roll_rad == math.radians(1.0)


def test_unrelated_or_blank_images_change_nothing() -> None:
    aligner = auto(every_pairs=1)
    blank = np.full((480, 640), 80, np.uint8)
    for left, right in ((pair(0, 0)[0], pair(0, 0, seed=1)[0]), (blank, blank), (pair(0, 0)[0], blank)):
        found = aligner.update(left, right)
        assert not found.estimated
        assert found.vertical_px == 0.0
    before = aligner.update(*pair(4.0, 0.5))
    assert aligner.update(pair(0, 0)[0], blank).vertical_px == before.vertical_px


def test_one_outlier_is_rejected_and_a_lasting_change_is_followed() -> None:
    aligner = auto(every_pairs=1)
    for seed in range(3):
        filtered = aligner.update(*pair(3.0, 0.0, seed=seed))
    assert filtered.vertical_px == pytest.approx(3.0, abs=0.1)
    assert aligner.update(*pair(-9.0, 0.0)).vertical_px == pytest.approx(3.0, abs=0.1)
    for _ in range(5):
        moved = aligner.update(*pair(-9.0, 0.0))
    assert moved.vertical_px == pytest.approx(-9.0, abs=0.2)


def test_none_and_calibrated_do_as_they_say() -> None:
    left, right = pair(4.0, 1.0)
    none = auto(mode="none").update(left, right)
    assert (none.vertical_px, none.roll_rad, none.apply(right) is right) == (0.0, 0.0, True)
    given = auto(mode="calibrated", vertical_px=4.0, roll_rad=math.radians(1.0)).update(left, right)
    assert (given.vertical_px, given.roll_rad) == (4.0, math.radians(1.0))


def test_a_point_returns_to_its_position_in_the_original_image() -> None:
    alignment = Alignment("calibrated", 7.0, math.radians(2.0))
    dot = np.zeros((101, 141), np.uint8)
    dot[30, 100] = 255
    rows, columns = np.nonzero(alignment.apply(dot) > 60)
    x, y = alignment.unaligned(float(columns.mean()), float(rows.mean()), 141, 101)
    assert x == pytest.approx(100.0, abs=0.6)
    assert y == pytest.approx(30.0, abs=0.6)
    assert alignment.unaligned(70.0, 50.0, 141, 101) == (70.0, 43.0)


@pytest.mark.skipif(not CHESSBOARDS.is_dir(), reason="shared/data/stereo_chessboard is not beside this checkout")
@pytest.mark.parametrize("number", range(1, 7))
def test_real_pairs_give_the_offset_of_their_board_corners(number: int) -> None:
    left, right = (grey(CHESSBOARDS / f"{eye}{number:02}.jpg") for eye in ("left", "right"))
    corners = [cv2.findChessboardCorners(image, (9, 6)) for image in (left, right)]
    assert all(found for found, _ in corners)
    offset = corners[0][1].reshape(-1, 2)[:, 1] - corners[1][1].reshape(-1, 2)[:, 1]
    assert auto().update(left, right).vertical_px == pytest.approx(float(offset.mean()), abs=1.5)


def test_later_estimates_wait_until_there_is_time() -> None:
    aligner = auto(every_pairs=1)
    for seed in range(5):
        before = aligner.update(*pair(3.0, 0.0, seed=seed))
    assert aligner.update(*pair(3.8, 0.0)) == before, "the pair's own figures do not wait for it"
    aligner.update_alignment()
    filtered = aligner.update(*pair(3.8, 0.0))
    assert filtered.vertical_px > before.vertical_px + 0.05
    aligner.update_alignment()
    aligner.update_alignment()  # nothing is deferred any more
    assert aligner.update(*pair(3.8, 0.0)).vertical_px > filtered.vertical_px + 0.01
