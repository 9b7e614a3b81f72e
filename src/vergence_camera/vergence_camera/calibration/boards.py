"""Calibration boards: their corners, and finding them in a picture (OpenCV 4 and 5)."""

import re
from dataclasses import dataclass
from typing import Any, Protocol

import cv2
import numpy as np
import numpy.typing as npt

from vergence_camera.frame import Pixels

Points = npt.NDArray[np.float32]

_SMALLEST_CHARUCO = 8


class BoardError(ValueError):
    """An invalid board, or a picture in which it is not found; the message says why."""


@dataclass(frozen=True)
class Detection:
    """Corners found: `ids` (N,) ascending, `points_px` (N, 2) in the picture, `points_m` (N, 3) on the board."""

    ids: npt.NDArray[np.int64]
    points_px: Points
    points_m: Points

    def only(self, ids: npt.NDArray[np.int64]) -> "Detection":
        """Return the corners that have one of `ids`."""
        keep = np.isin(self.ids, ids)
        return Detection(self.ids[keep], self.points_px[keep], self.points_m[keep])


class Board(Protocol):
    """A flat pattern with known corners."""

    def detect(self, grey: Pixels) -> Detection:
        """Return the corners in a picture (h, w); raise BoardError with the reason if they are not there."""
        ...

    @property
    def cells(self) -> tuple[int, int]:
        """Number of corners along x and y."""
        ...


@dataclass(frozen=True)
class Chessboard:
    """A chessboard of `columns` x `rows` inner corners with squares of `square_m`."""

    columns: int
    rows: int
    square_m: float

    def __post_init__(self) -> None:
        if self.columns < 3 or self.rows < 3:
            raise BoardError(f"board must have at least 3x3 inner corners: got {self.columns}x{self.rows}")
        _check_length("square_m", self.square_m)

    @property
    def cells(self) -> tuple[int, int]:
        """See Board."""
        return self.columns, self.rows

    def detect(self, grey: Pixels) -> Detection:
        """See Board. All corners must be visible."""
        flags = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE
        found, corners = cv2.findChessboardCorners(grey, (self.columns, self.rows), flags=flags)
        if not found:
            raise BoardError(f"no chessboard of {self.columns}x{self.rows} inner corners is wholly visible")
        # OpenCV 4 returns (N, 1, 2), OpenCV 5 (N, 2).
        points = np.ascontiguousarray(corners, dtype=np.float32).reshape(-1, 2)
        ids = np.arange(len(points))
        grid = np.stack([ids % self.columns, ids // self.columns, np.zeros(len(ids))], axis=1)
        refined = _refine(grey, points, self._spacing_px(points))
        return Detection(ids, refined, (grid * self.square_m).astype(np.float32))

    def _spacing_px(self, points: Points) -> float:
        grid = points.reshape(self.rows, self.columns, 2)
        along = np.linalg.norm(np.diff(grid, axis=1), axis=2)
        across = np.linalg.norm(np.diff(grid, axis=0), axis=2)
        return float(min(along.min(), across.min()))


@dataclass(frozen=True)
class Charuco:
    """A ChArUco board of `columns` x `rows` squares with markers of `marker_m`; it may be partly hidden."""

    columns: int
    rows: int
    square_m: float
    marker_m: float
    dictionary: str = "DICT_5X5_100"

    def __post_init__(self) -> None:
        _check_length("square_m", self.square_m)
        _check_length("marker_m", self.marker_m)
        if self.marker_m >= self.square_m:
            raise BoardError(f"marker_m must be less than square_m, {self.square_m:g}: got {self.marker_m:g}")
        if not hasattr(cv2, "aruco") or not hasattr(cv2.aruco, "CharucoDetector"):
            raise BoardError(f"ChArUco boards need OpenCV 4.7 or later: got {cv2.__version__}")
        if not hasattr(cv2.aruco, self.dictionary):
            known = ", ".join(sorted(name for name in dir(cv2.aruco) if name.startswith("DICT_")))
            raise BoardError(f"dictionary must be one of {known}: got {self.dictionary!r}")

    @property
    def cells(self) -> tuple[int, int]:
        """See Board."""
        return self.columns - 1, self.rows - 1

    def board(self) -> Any:
        """Return OpenCV's own CharucoBoard, which can also draw the board."""
        dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, self.dictionary))
        return cv2.aruco.CharucoBoard((self.columns, self.rows), self.square_m, self.marker_m, dictionary)

    def detect(self, grey: Pixels) -> Detection:
        """See Board."""
        board = self.board()
        corners, ids, _, _ = cv2.aruco.CharucoDetector(board).detectBoard(grey)
        count = 0 if ids is None else len(ids)
        if count < _SMALLEST_CHARUCO:
            raise BoardError(f"{count} ChArUco corners are visible, {_SMALLEST_CHARUCO} are needed")
        numbers = np.asarray(ids, dtype=np.int64).reshape(-1)
        order = np.argsort(numbers)
        points = np.asarray(corners, dtype=np.float32).reshape(-1, 2)[order]
        on_board = np.asarray(board.getChessboardCorners(), dtype=np.float32).reshape(-1, 3)
        return Detection(numbers[order], points, on_board[numbers[order]])


def parse_board(text: str, square_m: float, marker_m: float | None = None) -> Board:
    """Return the board that a text describes.

    Args:
        text: `9x6` is a chessboard by its inner corners; `charuco:8x6` or `charuco:8x6:DICT_4X4_50` by its squares.
        square_m: side of a square [m].
        marker_m: side of a marker [m]; three quarters of the square if not given.

    Raises:
        BoardError: a text that describes no board, or invalid sizes.
    """
    found = re.fullmatch(r"(charuco:)?(\d+)[xX](\d+)(?::(\w+))?", text)
    if found is None or (found.group(4) and not found.group(1)):
        raise BoardError(f"board must be COLUMNSxROWS or charuco:COLUMNSxROWS[:DICTIONARY]: got {text!r}")
    columns, rows = int(found.group(2)), int(found.group(3))
    if not found.group(1):
        return Chessboard(columns, rows, square_m)
    marker_m = 0.75 * square_m if marker_m is None else marker_m
    return Charuco(columns, rows, square_m, marker_m, *([found.group(4)] if found.group(4) else []))


def _refine(grey: Pixels, points: Points, spacing_px: float) -> Points:
    """Refine to sub-pixels in a window that no neighbouring corner reaches into."""
    half = int(np.clip(0.25 * spacing_px, 2, 11))
    criteria = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 100, 1e-4)
    seeds = np.ascontiguousarray(points.reshape(-1, 1, 2))
    refined = np.asarray(cv2.cornerSubPix(grey, seeds, (half, half), (-1, -1), criteria))
    return refined.reshape(-1, 2).astype(np.float32)


def _check_length(name: str, value: float) -> None:
    if not (np.isfinite(value) and 0.0 < value < 10.0):
        raise BoardError(f"{name} must be above 0 and below 10 [m]: got {value:g}")
