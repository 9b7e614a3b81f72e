"""Cost of metric I against what a user would write: every pair, a KD-tree or a distance transform per window."""

import time
from collections.abc import Callable, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from bench.results import Row
from vergence_metric.alignment.parameters import AlignmentParameters
from vergence_metric.edges.chance import chance_levels
from vergence_metric.edges.contrast import contrasts, foveal_contrast
from vergence_metric.edges.edge_distance import EdgeDistances, edge_distances
from vergence_metric.edges.edges import Edges, detect_edges
from vergence_metric.edges.nearest_edges import NearestEdges
from vergence_metric.edges.oriented_edges import oriented_field
from vergence_metric.edges.parameters import EdgeParameters
from vergence_metric.edges.robust import robust_distances
from vergence_metric.edges.windows import Window, centre_windows
from vergence_metric.measurement.edge_metric import EdgeMetric

Mask = NDArray[np.uint8]

PARAMETERS = EdgeParameters()
SHIFT_PX = 7


def run(say: Callable[[str], None]) -> list[Row]:
    """Measure both densities at 640x480, then the growth with the image; everything on one thread."""
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        return _rows(say)
    finally:
        cv2.setNumThreads(threads)


def _rows(say: Callable[[str], None]) -> list[Row]:
    windows = centre_windows(PARAMETERS.windows_px, 480, 640)
    by_name: dict[str, dict[str, tuple[float, float]]] = {}
    worst_error = 0.0
    for density, picture in (("sparse", sparse_picture()), ("chessboard", chessboard_picture())):
        left, right = (detect_edges(view, PARAMETERS) for view in views(picture, 480, 640))
        counts = [cv2.countNonZero(left.mask[window.slices]) for window in windows]
        say(f"{density}: {counts} edge pixels in the windows of {list(PARAMETERS.windows_px)} px")
        pairwise = _by_window(_pairwise, left.mask, right.mask, windows)
        ours = edge_distances(NearestEdges(left.mask, right.mask, windows))
        worst_error = max(worst_error, float(np.abs(_stacked(ours) - pairwise).max()))
        peers = {
            "pairwise": ("NumPy, every pair", _pairwise, 5),
            "kdtree": ("SciPy KD-tree per window", _kdtree, 30),
            "distance_transform": ("OpenCV precise distance transform per window", _distance_transform, 30),
        }
        ours_ms = _best_ms(lambda: edge_distances(NearestEdges(left.mask, right.mask, windows)), 60)  # noqa: B023
        for peer, (_, nearest, repeats) in peers.items():
            peer_ms = _best_ms(lambda: _by_window(nearest, left.mask, right.mask, windows), repeats)  # noqa: B023
            by_name.setdefault(f"edge.vs_{peer}", {})[density] = (ours_ms, peer_ms)
            say(f"{density}: {ours_ms:.2f} ms, {peers[peer][0]} {peer_ms:.2f} ms: {peer_ms / ours_ms:.1f} times faster")
        full_ms = _best_ms(lambda: everything(left, right, windows), 60)  # noqa: B023
        by_name.setdefault("edge.full_cost", {})[density] = (full_ms, by_name["edge.vs_kdtree"][density][1])
    against = {
        "edge.vs_pairwise": "NumPy, every pair",
        "edge.vs_kdtree": "SciPy KD-tree per window",
        "edge.vs_distance_transform": "OpenCV distance transform per window",
        "edge.full_cost": "SciPy KD-tree per window, plain metric alone",
    }
    rows = []
    for name, figures in by_name.items():
        worst = min(figures, key=lambda density: figures[density][1] / figures[density][0])
        rows.append(Row(name, figures[worst][0], "ms", against[name], figures[worst][1]))
        rows += [Row(f"{name}.{d}", mine, "ms", against[name], peer) for d, (mine, peer) in figures.items()]
    rows.append(Row("edge.error_px", worst_error, "px", "the definition, pair by pair", 0.0))
    return rows + _whole_pair_rows(say)


def _whole_pair_rows(say: Callable[[str], None]) -> list[Row]:
    """Return the cost of a whole pair, images to figures, and how it grows with the image."""
    rows, picture, per_pixel_ns = [], chessboard_picture(), {}
    for height, width in ((240, 320), (480, 640), (1080, 1920)):
        sizes = tuple(round(size * height / 480) for size in (50, 100, 150, 200, 250, 300))
        metric = EdgeMetric(
            EdgeParameters(windows_px=sizes), alignment=AlignmentParameters(mode="calibrated", vertical_px=1.0)
        )
        left, right = (cv2.cvtColor(view, cv2.COLOR_GRAY2BGR) for view in views(picture, height, width))
        best_ms = _best_ms(lambda: metric.measure(left, right), 200 if height < 1080 else 40)  # noqa: B023
        per_pixel_ns[height] = best_ms * 1e6 / (height * width)
        say(f"{width}x{height}, windows {sizes}: {best_ms:.2f} ms a pair, {per_pixel_ns[height]:.1f} ns a pixel")
        if height == 480:
            rows.append(Row("edge.pair_ms", best_ms, "ms"))
    return [*rows, Row("edge.growth", per_pixel_ns[1080] / per_pixel_ns[240], "times the cost a pixel", "320x240", 1.0)]


def everything(left: Edges, right: Edges, windows: Sequence[Window]) -> object:
    """Return the plain metric, chance level, contrast and robust form of a pair of edge images."""
    nearest = NearestEdges(left.mask, right.mask, windows)
    oriented = oriented_field(left, right, windows, bins=8, signed=True, truncation_px=5)
    return (
        edge_distances(nearest),
        chance_levels(nearest),
        contrasts(oriented, 5),
        foveal_contrast(oriented, 5, 14.0),
        robust_distances(oriented, 5, 20.0),
    )


def sparse_picture() -> Mask:
    """Return flat shapes on a plain ground: 80 edge pixels in the 50 px window to 1,560 in that of 300 px."""
    rng = np.random.default_rng(0)
    picture = np.full((600, 800), 120, np.uint8)
    for _ in range(75):
        corners = rng.uniform(0, (800, 600)) + rng.uniform(-22, 22, (4, 2))
        cv2.fillConvexPoly(picture, cv2.convexHull(corners.astype(np.int32)), int(rng.choice([30, 70, 190, 230])))
    return picture


def chessboard_picture() -> Mask:
    """Return a slanted chessboard of 24 px squares before a textured ground, as dense in edges as a real one."""
    board = np.zeros((14, 18), np.uint8)
    board[::2, 1::2] = board[1::2, ::2] = 200
    board = np.kron(board, np.ones((24, 24), np.uint8)) + np.uint8(25)
    noise = cv2.GaussianBlur(np.random.default_rng(5).normal(size=(600, 800)), (0, 0), 2.2)
    ground = np.clip(120 + 40 * noise / noise.std(), 0, 255).astype(np.uint8)
    place = np.array([[0.96, 0.13, 150.0], [-0.1, 0.94, 150.0]])
    seen = cv2.warpAffine(board, place, (800, 600))
    inside = cv2.warpAffine(np.full_like(board, 255), place, (800, 600)) > 127
    return np.where(inside, seen, ground)


def views(picture: Mask, height: int, width: int) -> tuple[Mask, Mask]:
    """Return two views of `picture` (600, 800), shifted against one another by 7 px of 640; nothing wraps around."""
    scale = height / 480
    resized = cv2.resize(picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC)
    if resized.shape[1] < width + round(SHIFT_PX * scale):  # wider than 4:3: the picture goes on, mirrored
        resized = np.hstack([resized, resized[:, ::-1]])
    top, left = (resized.shape[0] - height) // 2, (resized.shape[1] - width - round(SHIFT_PX * scale)) // 2
    rows = slice(top, top + height)
    return resized[rows, left : left + width].copy(), resized[
        rows, left + round(SHIFT_PX * scale) : left + round(SHIFT_PX * scale) + width
    ].copy()


Nearest = Callable[[Mask, Mask], float]


def _by_window(nearest: Nearest, left: Mask, right: Mask, windows: Sequence[Window]) -> NDArray[np.float64]:
    return np.array(
        [
            [nearest(from_[window.slices], to[window.slices]) for window in windows]
            for from_, to in ((left, right), (right, left))
        ]
    )


def _pairwise(from_: Mask, to: Mask) -> float:
    a, b = np.argwhere(from_), np.argwhere(to)
    down, across = a[:, None, 0] - b[:, 0], a[:, None, 1] - b[:, 1]
    return float(np.sqrt(down * down + across * across).min(axis=1).mean())


def _kdtree(from_: Mask, to: Mask) -> float:
    return float(cKDTree(np.argwhere(to)).query(np.argwhere(from_))[0].mean())


def _distance_transform(from_: Mask, to: Mask) -> float:
    distance = cv2.distanceTransform((to == 0).view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return float(distance[from_ > 0].mean())


def _stacked(distances: EdgeDistances) -> NDArray[np.float64]:
    return np.array([distances.left_to_right_px, distances.right_to_left_px])


def _best_ms(work: Callable[[], object], repeats: int) -> float:
    """Return the shortest of several runs [ms of this thread's CPU time]: the machine may be shared."""
    best = np.inf
    for _ in range(repeats):
        started = time.thread_time()
        work()
        best = min(best, time.thread_time() - started)
    return float(best) * 1e3
