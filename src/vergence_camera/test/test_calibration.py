"""Calibration on drawn boards whose camera is known, and on real pictures whose camera was published."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from vergence_camera.calibration.boards import Board, BoardError, Charuco, Chessboard, Detection, parse_board
from vergence_camera.calibration.report import intrinsics_text, pose_text, stereo_document, write_results
from vergence_camera.calibration.solve import SolveError, StereoPose, check_sides, solve_camera, solve_pair
from vergence_camera.calibration.views import EYES, View, ViewCollector, coverage_of
from vergence_camera.camera_info import load_calibration

DATA = Path(__file__).resolve().parents[4] / "shared" / "data" / "stereo_chessboard"
SIZE = (640, 480)
K = np.array([[600.0, 0.0, 330.0], [0.0, 598.0, 235.0], [0.0, 0.0, 1.0]])
D = np.array([-0.2, 0.05, 0.001, -0.0005, 0.0])
TURN = np.array([0.01, -0.03, 0.005])
SHIFT = np.array([-0.065, 0.001, 0.002])
BOARD = Chessboard(9, 6, 0.025)


def poses(count: int, seed: int = 3) -> Iterator[tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]]:
    """Poses of the board in front of both eyes."""
    random = np.random.default_rng(seed)
    while count:
        turn = random.uniform(-0.6, 0.6, 3) * (1, 1, 0.3)
        shift = np.array([random.uniform(-0.25, 0.12), random.uniform(-0.15, 0.05), random.uniform(0.3, 0.6)])
        corners = [project(turn, shift, eye) for eye in EYES]
        if all((c > 5).all() and (c < np.array(SIZE) - 5).all() for c in corners):
            count -= 1
            yield turn, shift


def project(
    turn: npt.NDArray[np.float64], shift: npt.NDArray[np.float64], eye: str, board_m: object = None
) -> npt.NDArray[np.float32]:
    if board_m is None:
        grid = np.mgrid[0:9, 0:6].T.reshape(-1, 2) * 0.025
        board_m = np.hstack([grid, np.zeros((54, 1))])
    if eye == "right":
        rotation = cv2.Rodrigues(TURN)[0]
        turn, shift = cv2.Rodrigues(rotation @ cv2.Rodrigues(turn)[0])[0], rotation @ shift + SHIFT
    points = cv2.projectPoints(board_m, turn, shift, K, D)[0]
    return np.asarray(points, dtype=np.float32).reshape(-1, 2)


def view(name: str, turn: npt.NDArray[np.float64], shift: npt.NDArray[np.float64]) -> View:
    grid = np.hstack([np.mgrid[0:9, 0:6].T.reshape(-1, 2) * 0.025, np.zeros((54, 1))]).astype(np.float32)
    return View(name, {eye: Detection(np.arange(54), project(turn, shift, eye), grid) for eye in EYES})


def test_exact_corners_give_the_camera_back() -> None:
    views = [view(str(n), *pose) for n, pose in enumerate(poses(14))]
    left, right = (solve_camera(views, eye, SIZE) for eye in EYES)
    for found in (left, right):
        assert found.rms_px < 1e-3
        assert np.allclose(found.matrix, K, atol=0.05)
        assert np.allclose(found.distortion[:2], D[:2], atol=0.01)
    pose = solve_pair(views, left, right)
    assert np.allclose(pose.rotation, cv2.Rodrigues(TURN)[0], atol=1e-4)
    assert np.allclose(pose.translation_m, SHIFT, atol=1e-5)
    assert pose.baseline_m == pytest.approx(np.linalg.norm(SHIFT), abs=1e-5)


def test_uncertainties_cover_the_truth() -> None:
    random = np.random.default_rng(1)
    views = []
    for number, pose in enumerate(poses(8, seed=5)):
        exact = view(str(number), *pose)
        noisy = {
            eye: Detection(d.ids, d.points_px + random.normal(0, 0.2, (54, 2)).astype(np.float32), d.points_m)
            for eye, d in exact.corners.items()
        }
        views.append(View(exact.name, noisy))
    found = solve_camera(views, "left", SIZE)
    assert 0.2 < found.rms_px < 0.4
    assert abs(found.matrix[0, 0] - K[0, 0]) < 5 * found.focal_sigma_px[0]
    assert found.focal_sigma_px[0] < 10


def test_a_view_that_does_not_fit_is_left_out_and_named() -> None:
    views = [view(str(n), *pose) for n, pose in enumerate(poses(8))]
    wrong = views[3].corners["left"]
    random = np.random.default_rng(0)
    bent = Detection(wrong.ids, wrong.points_px + random.normal(0, 4, (54, 2)).astype(np.float32), wrong.points_m)
    views[3] = View("bent", {**views[3].corners, "left": bent})
    found = solve_camera(views, "left", SIZE)
    assert list(found.rejected) == ["bent"]
    assert "px off" in found.rejected["bent"]
    assert np.allclose(found.matrix, K, atol=0.5)


def test_a_board_that_moved_between_the_eyes_is_left_out() -> None:
    views = [view(str(n), *pose) for n, pose in enumerate(poses(8))]
    moved = view("other", *list(poses(9))[8])
    views[2] = View("moved", {"left": views[2].corners["left"], "right": moved.corners["right"]})
    left, right = (solve_camera(views, eye, SIZE) for eye in EYES)
    pose = solve_pair(views, left, right)
    assert list(pose.rejected) == ["moved"]
    assert "did the board move" in pose.rejected["moved"]
    assert np.allclose(pose.translation_m, SHIFT, atol=1e-4)


def test_too_few_views() -> None:
    views = [view(str(n), *pose) for n, pose in enumerate(poses(2))]
    with pytest.raises(SolveError, match="2 usable views, at least 3"):
        solve_camera(views, "left", SIZE)


def draw_chessboard(turn: npt.NDArray[np.float64], shift: npt.NDArray[np.float64]) -> npt.NDArray[np.uint8]:
    """A photograph of the board by the left camera without distortion, smoothed as a lens does."""
    scale = 8
    squares = np.full((9, 12), 255, np.uint8)
    squares[1:-1, 1:-1] = np.where(np.indices((7, 10)).sum(axis=0) % 2, 255, 20)
    flat = cv2.resize(squares, None, fx=32, fy=32, interpolation=cv2.INTER_NEAREST)
    # The corner (0, 0) lies two squares in, at pixel edges 64.
    to_board = np.diag([0.025 / 32, 0.025 / 32, 1.0]) @ np.array([[1, 0, -63.5], [0, 1, -63.5], [0, 0, 1.0]])
    rotation = cv2.Rodrigues(turn)[0]
    plane = K @ np.column_stack([rotation[:, 0], rotation[:, 1], shift])
    big = np.array([[scale, 0, (scale - 1) / 2], [0, scale, (scale - 1) / 2], [0, 0, 1.0]])
    size = (SIZE[0] * scale // 2, SIZE[1] * scale // 2)
    half = np.diag([0.5, 0.5, 1.0])
    warped = cv2.warpPerspective(flat, half @ big @ plane @ to_board, size, flags=cv2.INTER_LINEAR, borderValue=255)
    small = cv2.resize(warped, SIZE, interpolation=cv2.INTER_AREA)
    return np.asarray(cv2.GaussianBlur(small, (0, 0), 0.8), dtype=np.uint8)


@pytest.mark.parametrize("seed", [1, 2])
def test_corners_of_a_drawn_chessboard_are_found_to_a_tenth_of_a_pixel(seed: int) -> None:
    ((turn, shift),) = poses(1, seed)
    detection = BOARD.detect(draw_chessboard(turn, shift))
    expected = cv2.projectPoints(detection.points_m, turn, shift, K, np.zeros(5))[0].reshape(-1, 2)
    # The other way round is the same board.
    error = min(np.abs(detection.points_px - e).max() for e in (expected, expected[::-1]))
    assert error < 0.15


finds_charuco = pytest.mark.skipif(
    not hasattr(getattr(cv2, "aruco", None), "CharucoDetector"), reason="this OpenCV cannot find ChArUco boards"
)


@finds_charuco
def test_charuco_is_found_even_when_partly_hidden() -> None:
    board = parse_board("charuco:8x6:DICT_4X4_50", 0.03, 0.022)
    assert isinstance(board, Charuco)
    drawn = np.asarray(board.board().generateImage((640, 480), marginSize=20))
    whole = board.detect(drawn)
    assert len(whole.ids) == 35 == board.cells[0] * board.cells[1]
    assert np.allclose(np.diff(whole.points_m[:7, 0]), 0.03)
    drawn[:, :250] = 255
    part = board.detect(drawn)
    assert 8 <= len(part.ids) < 35
    assert np.allclose(part.points_px, whole.only(part.ids).points_px, atol=0.5)
    with pytest.raises(BoardError, match="corners are visible"):
        board.detect(np.full((480, 640), 255, np.uint8))


@pytest.mark.parametrize(
    ("text", "square_m", "marker_m", "reason"),
    [
        ("9by6", 0.025, None, "COLUMNSxROWS"),
        ("2x6", 0.025, None, "at least 3x3"),
        ("9x6", 0.0, None, "square_m"),
        ("9x6", float("nan"), None, "square_m"),
        ("9x6:DICT_4X4_50", 0.025, None, "charuco:"),
        ("charuco:8x6", 0.02, 0.03, "less than square_m"),
        pytest.param("charuco:8x6:DICT_NONE", 0.02, 0.01, "DICT_4X4_50", marks=finds_charuco),
    ],
)
def test_boards_that_cannot_be(text: str, square_m: float, marker_m: float | None, reason: str) -> None:
    with pytest.raises(BoardError, match=reason):
        parse_board(text, square_m, marker_m)


class DrawnBoard:
    """A board whose detections are handed over instead of found."""

    cells = (9, 6)

    def __init__(self) -> None:
        self.next: list[Detection | BoardError] = []

    def detect(self, grey: object) -> Detection:
        result = self.next.pop(0)
        if isinstance(result, BoardError):
            raise result
        return result


PICTURE = np.zeros((480, 640), np.uint8)


def offer(collector: ViewCollector, board: DrawnBoard, name: str, *results: Detection | BoardError) -> str:
    board.next = list(results)
    pictures = dict(zip(EYES, [PICTURE] * len(results), strict=False))
    return collector.offer(name, pictures).reason


def test_rejections_have_reasons() -> None:
    board = DrawnBoard()
    collector = ViewCollector(board)
    one, other = (view(str(n), *pose) for n, pose in enumerate(poses(2)))
    assert offer(collector, board, "a", one.corners["left"], one.corners["right"]) == ""
    assert offer(collector, board, "b", one.corners["left"], one.corners["right"]) == "shows the same as a"
    assert offer(collector, board, "c", other.corners["left"], BoardError("no board")) == "right: no board"
    verdict = collector.offer("d", {"left": np.zeros((240, 320), np.uint8)})
    assert verdict.reason == "left: 320x240 px, the first picture has 640x480"
    board.next = [other.corners["left"], other.corners["right"]]
    refused = collector.offer("e", {"left": PICTURE, "right": PICTURE}, is_steady=lambda view: False)
    assert refused.reason == "the board moves"
    assert [v.accepted for v in collector.verdicts] == [True, False, False, False, False]
    assert len(collector.views) == 1


def test_a_board_read_from_the_other_end_is_turned() -> None:
    board = DrawnBoard()
    collector = ViewCollector(board)
    (pose,) = poses(1)
    exact = view("a", *pose)
    right = exact.corners["right"]
    turned = Detection(right.ids, right.points_px[::-1].copy(), right.points_m)
    assert offer(collector, board, "a", exact.corners["left"], turned) == ""
    assert np.array_equal(collector.views[0].corners["right"].points_px, right.points_px)


def test_coverage_and_its_advice() -> None:
    grid = np.hstack([np.mgrid[0:9, 0:6].T.reshape(-1, 2) * 0.025, np.zeros((54, 1))]).astype(np.float32)
    middle = (np.mgrid[0:9, 0:6].T.reshape(-1, 2) * 10 + (280, 220)).astype(np.float32)
    small = coverage_of([Detection(np.arange(54), middle, grid)], SIZE, (9, 6))
    assert small.fraction < 0.2
    assert len(small.advice()) == 3
    assert "top left, top right, bottom left, bottom right" in small.advice()[0]
    assert small.drawing().count("\n") == 5
    many = [view(str(n), *pose).corners["left"] for n, pose in enumerate(poses(25))]
    good = coverage_of(many, SIZE, (9, 6))
    assert good.fraction > 0.6
    assert not [text for text in good.advice() if "tilt" in text or "nearer" in text]


def test_files_and_texts(tmp_path: Path) -> None:
    collector = ViewCollector(DrawnBoard(), size_px=dict.fromkeys(EYES, SIZE))
    collector.views = [view(str(n), *pose) for n, pose in enumerate(poses(6))]
    cameras = {eye: solve_camera(collector.views, eye, SIZE) for eye in EYES}
    pose = solve_pair(collector.views, cameras["left"], cameras["right"])
    written = write_results(tmp_path, cameras, pose, {"pattern": "9x6", "square_m": 0.025})
    assert [path.name for path in written] == ["left.yaml", "right.yaml", "stereo.yaml"]
    assert load_calibration(written[0]).k[0] == pytest.approx(600.0, abs=0.5)
    document = stereo_document(cameras, pose, {})
    assert document["baseline_m"] == pytest.approx(0.065, abs=1e-3)
    assert len(document["rotation"]["data"]) == 9
    assert "focal length  600" in intrinsics_text("left", cameras["left"], collector.coverage("left"))
    assert "baseline 65" in pose_text(pose)


needs_data = pytest.mark.skipif(not DATA.is_dir(), reason="the chessboard pictures (../shared/data) are not here")


@needs_data
def test_the_published_camera() -> None:
    """OpenCV publishes a focal length of 535.9 px for the left camera of this set."""
    board: Board = BOARD
    collector = ViewCollector(board)
    for number in range(1, 7):
        pictures = {eye: np.asarray(cv2.imread(str(DATA / f"{eye}{number:02d}.jpg"), 0)) for eye in EYES}
        assert collector.offer(str(number), pictures).accepted
    left, right = (solve_camera(collector.views, eye, SIZE) for eye in EYES)
    pose = solve_pair(collector.views, left, right)
    assert max(left.rms_px, right.rms_px, pose.rms_px) <= 0.3
    assert left.matrix[0, 0] == pytest.approx(535.9, rel=0.01)
    assert left.matrix[1, 1] == pytest.approx(535.9, rel=0.01)


@needs_data
@pytest.mark.parametrize("shape", [(-1, 1, 2), (-1, 2)])
def test_either_shape_of_opencvs_corners(monkeypatch: pytest.MonkeyPatch, shape: tuple[int, ...]) -> None:
    picture = np.asarray(cv2.imread(str(DATA / "left01.jpg"), 0))
    expected = BOARD.detect(picture).points_px
    find = cv2.findChessboardCorners

    def reshaped(*args: Any, **options: Any) -> tuple[bool, npt.NDArray[np.float32]]:
        found, corners = find(*args, **options)
        return found, np.asarray(corners).reshape(shape)

    monkeypatch.setattr(cv2, "findChessboardCorners", reshaped)
    assert np.array_equal(BOARD.detect(picture).points_px, expected)


@pytest.mark.parametrize(
    ("translation_m", "swapped"),
    [((-0.065, 0.0, 0.0), False), ((0.065, 0.002, 0.01), True), ((1e-6, 0.0, 0.0), False), ((0.01, 0.1, 0.0), False)],
)
def test_eyes_that_are_swapped_are_refused(translation_m: tuple[float, float, float], swapped: bool) -> None:
    pose = StereoPose(np.eye(3), np.array(translation_m), 0.1, {}, {})
    if swapped:
        with pytest.raises(SolveError, match=r"65\.0 mm to its left; exchange --left and --right"):
            check_sides(pose)
    else:
        check_sides(pose)
