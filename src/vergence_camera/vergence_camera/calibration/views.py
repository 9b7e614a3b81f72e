"""Collecting views of a board: which ones are kept, and how well they cover the picture."""

from collections.abc import Callable
from dataclasses import dataclass, field

import cv2
import numpy as np
import numpy.typing as npt

from vergence_camera.calibration.boards import Board, BoardError, Detection
from vergence_camera.frame import Pixels

EYES = ("left", "right")
_COVERAGE_GRID = (8, 6)


@dataclass(frozen=True)
class View:
    """One look at the board: its name and the corners in each eye that is calibrated."""

    name: str
    corners: dict[str, Detection]


@dataclass(frozen=True)
class Verdict:
    """Whether a view was accepted; `reason` says why it was rejected."""

    name: str
    accepted: bool
    reason: str = ""


@dataclass(frozen=True)
class Coverage:
    """How the corners of one eye fill the picture.

    `cells` (6, 8) counts corners per cell. `sizes` and `slants` are the ranges of the board's extent relative to the
    picture's and of the ratio of its opposite sides: a range of less than about 0.1 leaves the focal length uncertain.
    """

    cells: npt.NDArray[np.int64]
    sizes: tuple[float, float]
    slants: tuple[float, float]

    @property
    def fraction(self) -> float:
        """Part of the cells that hold a corner, 0 to 1."""
        return float(np.mean(self.cells > 0))

    def advice(self) -> list[str]:
        """Return what further views should show."""
        texts = []
        names = {(0, 0): "top left", (0, -1): "top right", (-1, 0): "bottom left", (-1, -1): "bottom right"}
        empty = [name for (row, column), name in names.items() if not self._corner(row, column)]
        if empty:
            texts.append("show the board in the " + ", ".join(empty) + " of the picture")
        if self.sizes[1] - self.sizes[0] < 0.1:
            texts.append("show it nearer and farther away")
        if self.slants[1] - self.slants[0] < 0.1:
            texts.append("tilt it more, to all sides")
        return texts

    def _corner(self, row: int, column: int) -> bool:
        rows = slice(0, 2) if row == 0 else slice(-2, None)
        columns = slice(0, 2) if column == 0 else slice(-2, None)
        return bool(self.cells[rows, columns].any())

    def drawing(self) -> str:
        """Return the cells as text, one line per row: '.' is empty, '#' well covered."""
        signs = np.array(list(".:+#"))
        return "\n".join("".join(signs[np.digitize(row, [1, 4, 12])]) for row in self.cells)


@dataclass
class ViewCollector:
    """Collects views of one eye or of a pair, and records why others were rejected.

    `least_change` is the least mean movement of the corners against every view kept so far, relative to the picture's
    width; it prevents a live stream from adding the same view repeatedly.
    """

    board: Board
    least_change: float = 0.005
    views: list[View] = field(default_factory=list)
    verdicts: list[Verdict] = field(default_factory=list)
    size_px: dict[str, tuple[int, int]] = field(default_factory=dict)

    def offer(self, name: str, pictures: dict[str, Pixels], is_steady: Callable[[View], bool] | None = None) -> Verdict:
        """Look for the board in `pictures` (by eye: "left", "right") and keep the view if it is useful.

        `is_steady` may refuse a view that was found, such as one during which the board moved.
        """
        try:
            view = self._look(name, pictures)
            if is_steady is not None and not is_steady(view):
                raise BoardError("the board moves")
            self._check_new(view)
        except BoardError as error:
            verdict = Verdict(name, False, str(error))
        else:
            self.views.append(view)
            verdict = Verdict(name, True)
        self.verdicts.append(verdict)
        return verdict

    def coverage(self, eye: str) -> Coverage:
        """Return how the kept views fill the picture of `eye`."""
        return coverage_of([view.corners[eye] for view in self.views], self.size_px.get(eye, (1, 1)), self.board.cells)

    def _look(self, name: str, pictures: dict[str, Pixels]) -> View:
        corners = {}
        for eye, picture in pictures.items():
            size = (picture.shape[1], picture.shape[0])
            expected = self.size_px.setdefault(eye, size)
            if size != expected:
                raise BoardError(f"{eye}: {size[0]}x{size[1]} px, the first picture has {expected[0]}x{expected[1]}")
            grey = picture if picture.ndim == 2 else np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY))
            try:
                corners[eye] = self.board.detect(grey)
            except BoardError as error:
                raise BoardError(f"{eye}: {error}") from None
        if len(corners) == 2:
            corners = _matched(corners)
        return View(name, corners)

    def _check_new(self, view: View) -> None:
        for kept in self.views:
            changes = [_change(view.corners[eye], kept.corners[eye]) / self.size_px[eye][0] for eye in view.corners]
            if max(changes) < self.least_change:
                raise BoardError(f"shows the same as {kept.name}")


def coverage_of(detections: list[Detection], size_px: tuple[int, int], cells: tuple[int, int]) -> Coverage:
    """Return the coverage of one picture of `size_px` (width, height) by detections on a board of `cells` corners."""
    columns, rows = _COVERAGE_GRID
    counts = np.zeros((rows, columns), dtype=np.int64)
    sizes, slants = [], []
    width, height = size_px
    for detection in detections:
        points = detection.points_px
        x = np.clip(points[:, 0] * columns / width, 0, columns - 1).astype(int)
        y = np.clip(points[:, 1] * rows / height, 0, rows - 1).astype(int)
        np.add.at(counts, (y, x), 1)
        extent = points.max(axis=0) - points.min(axis=0)
        sizes.append(float(np.sqrt(extent[0] * extent[1] / (width * height))))
        slants.append(_slant(detection, cells))
    return Coverage(counts, _range(sizes), _range(slants))


def _slant(detection: Detection, cells: tuple[int, int]) -> float:
    """Return log ratios of opposite sides, the larger of both directions, signed; 0 if corners are missing."""
    if len(detection.ids) != cells[0] * cells[1]:
        return 0.0
    grid = detection.points_px.reshape(cells[1], cells[0], 2)

    def log_ratio(one: npt.NDArray[np.float32], other: npt.NDArray[np.float32]) -> float:
        return float(np.log(np.linalg.norm(one[0] - one[-1]) / np.linalg.norm(other[0] - other[-1])))

    ratios = (log_ratio(grid[0], grid[-1]), log_ratio(grid[:, 0], grid[:, -1]))
    return max(ratios, key=abs)


def _range(values: list[float]) -> tuple[float, float]:
    return (min(values), max(values)) if values else (0.0, 0.0)


def _matched(corners: dict[str, Detection]) -> dict[str, Detection]:
    """Return the corners that both eyes see, in one order.

    A chessboard may be read from either end. Two eyes side by side see it the same way up, so that the direction from
    the first to the last corner must agree.
    """
    left, right = corners["left"], corners["right"]
    common = np.intersect1d(left.ids, right.ids)
    if len(common) < 6:
        raise BoardError(f"the eyes see {len(common)} corners in common, 6 are needed")
    left, right = left.only(common), right.only(common)
    direction = (left.points_px[-1] - left.points_px[0]) @ (right.points_px[-1] - right.points_px[0])
    if direction < 0:
        right = Detection(right.ids, right.points_px[::-1].copy(), right.points_m)
    return {"left": left, "right": right}


def _change(one: Detection, other: Detection) -> float:
    common = np.intersect1d(one.ids, other.ids)
    if len(common) < 4:
        return np.inf
    return float(np.linalg.norm(one.only(common).points_px - other.only(common).points_px, axis=1).mean())
