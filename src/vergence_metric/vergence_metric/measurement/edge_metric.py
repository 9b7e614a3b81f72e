"""The edge metric of a stereo pair in one call: what the node and `vergence measure` share."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vergence_metric.alignment.alignment import Aligner, Alignment
from vergence_metric.edges.chance import chance_levels
from vergence_metric.edges.contrast import contrasts, foveal_contrast
from vergence_metric.edges.edge_distance import edge_distances
from vergence_metric.edges.edges import Edges, Grey, ImageShapeError, detect_edges, to_grey
from vergence_metric.edges.nearest_edges import NearestEdges
from vergence_metric.edges.oriented_edges import oriented_field
from vergence_metric.edges.parameters import EdgeMetricParameters
from vergence_metric.edges.robust import robust_distances
from vergence_metric.edges.scratch import Scratch
from vergence_metric.edges.windows import Window, centre_windows

Figures = NDArray[np.float64]


@dataclass(frozen=True)
class AlignedPair:
    """Grey images (h, w) uint8 of one size, `alignment` taken out of the right one, and the seconds each stage took."""

    left_grey: Grey
    right_grey: Grey
    alignment: Alignment
    stage_s: dict[str, float]


@dataclass(frozen=True)
class EdgeMetricResult:
    """Everything measured on one pair; element i of each array belongs to `windows[i]`.

    `left_grey` and `right_grey` (h, w) uint8 are what was compared: `alignment` is already taken out of the right one.
    Arrays carry the names of vergence_msgs/EdgeVergence; figures are float64 and NaN where `status` (WindowStatus) says
    why. `foveal_contrast` is what VergedJudge takes. `stage_s` holds the seconds that each stage took.
    """

    windows: tuple[Window, ...]
    alignment: Alignment
    left_grey: Grey
    right_grey: Grey
    left_edges: Edges
    right_edges: Edges
    left_to_right_px: Figures
    right_to_left_px: Figures
    left_edge_count: NDArray[np.int64]
    right_edge_count: NDArray[np.int64]
    chance_left_to_right_px: Figures
    chance_right_to_left_px: Figures
    contrast_left_to_right: Figures
    contrast_right_to_left: Figures
    contrast: Figures
    foveal_contrast: float
    robust_left_to_right_px: Figures
    robust_right_to_left_px: Figures
    status: NDArray[np.uint8]
    stage_s: dict[str, float] = field(default_factory=dict)

    @property
    def windows_px(self) -> NDArray[np.uint32]:
        """Sides of the windows as asked for [px]."""
        return np.array([window.size_px for window in self.windows], np.uint32)


class EdgeMetric:
    """Measures pair after pair, on one thread; keeps only what alignment filters over time, and its memory."""

    def __init__(self, parameters: EdgeMetricParameters) -> None:
        self.parameters = parameters
        self._aligner = Aligner(parameters)
        self._scratch = Scratch()

    def measure(self, left: NDArray[Any], right: NDArray[Any]) -> EdgeMetricResult:
        """Measure a pair of (h, w, 3) BGR or (h, w) grey uint8 images of one size.

        Raises ImageShapeError where the images are not, or differ in size.
        """
        return self.measure_aligned(self.align(left, right))

    def align(self, left: NDArray[Any], right: NDArray[Any]) -> AlignedPair:
        """Return a pair as it will be compared; raises ImageShapeError as `measure` does."""
        if left.shape[:2] != right.shape[:2]:
            raise ImageShapeError(f"left image is {left.shape[:2]}, right is {right.shape[:2]}: they must be alike")
        stage_s = dict[str, float]()
        with _timed(stage_s, "grey"):
            left_grey, right_grey = to_grey(left), to_grey(right)
        with _timed(stage_s, "align"):
            alignment = self._aligner.update(left_grey, right_grey)
            right_grey = alignment.apply(right_grey)
        return AlignedPair(left_grey, right_grey, alignment, stage_s)

    def settle(self) -> None:
        """Do what was put off until a pair's figures are out; left undone, the next pair does it."""
        self._aligner.settle()

    def measure_aligned(self, pair: AlignedPair) -> EdgeMetricResult:
        """Measure a pair that `align` has made ready."""
        p, stage_s = self.parameters, dict(pair.stage_s)
        left_grey, right_grey = pair.left_grey, pair.right_grey
        with _timed(stage_s, "edges"):
            left_edges, right_edges = detect_edges(left_grey, p), detect_edges(right_grey, p)
        windows = centre_windows(p.windows_px, *left_grey.shape)
        with _timed(stage_s, "distance"):
            nearest = NearestEdges(left_edges.mask, right_edges.mask, windows, self._scratch)
            distances = edge_distances(nearest)
        with _timed(stage_s, "chance"):
            chance = chance_levels(nearest)
        with _timed(stage_s, "contrast"):
            oriented = oriented_field(
                left_edges,
                right_edges,
                windows,
                bins=p.orientation_bins,
                signed=p.orientation_signed,
                truncation_px=max(p.contrast_truncation_px, p.robust_truncation_px),
                scratch=self._scratch,
            )
            contrast = contrasts(oriented, p.contrast_truncation_px)
            foveal = foveal_contrast(oriented, p.contrast_truncation_px, p.verged_sigma_px)
            robust_left, robust_right = robust_distances(oriented, p.robust_truncation_px, p.fovea_sigma_px)
        rank = np.argsort(np.argsort([window.size_px for window in windows]))  # oriented figures are sorted by size
        return EdgeMetricResult(
            windows,
            pair.alignment,
            left_grey,
            right_grey,
            left_edges,
            right_edges,
            distances.left_to_right_px,
            distances.right_to_left_px,
            distances.left_count,
            distances.right_count,
            chance.left_to_right_px,
            chance.right_to_left_px,
            contrast.left_to_right[rank],
            contrast.right_to_left[rank],
            contrast.both[rank],
            foveal,
            robust_left[rank],
            robust_right[rank],
            distances.status,
            stage_s,
        )


@contextmanager
def _timed(stage_s: dict[str, float], name: str) -> Iterator[None]:
    started = time.perf_counter()
    yield
    stage_s[name] = time.perf_counter() - started
