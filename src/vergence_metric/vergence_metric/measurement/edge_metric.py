"""The edge metric of a stereo pair in one call, for the node and `vergence measure`."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vergence_metric.alignment.alignment import Aligner, Alignment
from vergence_metric.alignment.parameters import AlignmentParameters
from vergence_metric.edges.chance import chance_levels
from vergence_metric.edges.contrast import contrasts, foveal_contrast
from vergence_metric.edges.edge_distance import edge_distances
from vergence_metric.edges.edges import Edges, Grey, ImageShapeError, detect_edges, to_grey
from vergence_metric.edges.nearest_edges import NearestEdges
from vergence_metric.edges.oriented_edges import oriented_field
from vergence_metric.edges.parameters import ContrastParameters, EdgeParameters
from vergence_metric.edges.robust import robust_distances
from vergence_metric.edges.scratch import Scratch
from vergence_metric.edges.windows import Window, centre_windows

Values = NDArray[np.float64]


@dataclass(frozen=True)
class AlignedPair:
    """Grey images (h, w) uint8 of one size, the right aligned by `alignment`, and the durations of the stages [s]."""

    left_grey: Grey
    right_grey: Grey
    alignment: Alignment
    stage_s: dict[str, float]


@dataclass(frozen=True)
class EdgeMetricResult:
    """Everything measured on one pair; element i of each array belongs to `windows[i]`.

    `left_grey` and `right_grey` (h, w) uint8 are the images compared, the right one aligned. Arrays carry
    the names of vergence_msgs/EdgeVergence; values are float64, NaN where `status` (WindowStatus) gives a reason.
    `foveal_contrast` is weighted by a Gaussian about the centre. `stage_s` is the duration of each stage [s].
    """

    windows: tuple[Window, ...]
    alignment: Alignment
    left_grey: Grey
    right_grey: Grey
    left_edges: Edges
    right_edges: Edges
    left_to_right_px: Values
    right_to_left_px: Values
    left_edge_count: NDArray[np.int64]
    right_edge_count: NDArray[np.int64]
    chance_left_to_right_px: Values
    chance_right_to_left_px: Values
    contrast_left_to_right: Values
    contrast_right_to_left: Values
    contrast: Values
    foveal_contrast: float
    robust_left_to_right_px: Values
    robust_right_to_left_px: Values
    status: NDArray[np.uint8]
    stage_s: dict[str, float] = field(default_factory=dict)

    @property
    def windows_px(self) -> NDArray[np.uint32]:
        """Requested sides of the windows [px]."""
        return np.array([window.size_px for window in self.windows], np.uint32)


class EdgeMetric:
    """Measures successive pairs, on one thread; its only state is the filtered alignment and reused memory."""

    def __init__(
        self,
        edges: EdgeParameters | None = None,
        contrast: ContrastParameters | None = None,
        alignment: AlignmentParameters | None = None,
    ) -> None:
        """Measure by these parameters; None stands for the defaults."""
        self._edges = edges or EdgeParameters()
        self._contrast = contrast or ContrastParameters()
        self._aligner = Aligner(alignment or AlignmentParameters())
        self._scratch = Scratch()

    def measure(self, left: NDArray[Any], right: NDArray[Any]) -> EdgeMetricResult:
        """Measure a pair of (h, w, 3) BGR or (h, w) grey uint8 images of one size.

        Raises ImageShapeError where the images are not, or differ in size.
        """
        return self.measure_aligned(self.align(left, right))

    def align(self, left: NDArray[Any], right: NDArray[Any]) -> AlignedPair:
        """Return a pair in grey and aligned; raises ImageShapeError as `measure` does."""
        if left.shape[:2] != right.shape[:2]:
            raise ImageShapeError(
                f"left and right images must have one size: got {left.shape[:2]} and {right.shape[:2]}"
            )
        stage_s = dict[str, float]()
        with _timed(stage_s, "grey"):
            left_grey, right_grey = to_grey(left), to_grey(right)
        with _timed(stage_s, "align"):
            alignment = self._aligner.update(left_grey, right_grey)
            right_grey = alignment.apply(right_grey)
        return AlignedPair(left_grey, right_grey, alignment, stage_s)

    def update_alignment(self) -> None:
        """Compute the deferred estimate of alignment, if any; if not called, the next pair does it."""
        self._aligner.update_alignment()

    def measure_aligned(self, pair: AlignedPair) -> EdgeMetricResult:
        """Measure a pair that `align` has returned."""
        p, stage_s = self._contrast, dict(pair.stage_s)
        left_grey, right_grey = pair.left_grey, pair.right_grey
        with _timed(stage_s, "edges"):
            left_edges, right_edges = detect_edges(left_grey, self._edges), detect_edges(right_grey, self._edges)
        windows = centre_windows(self._edges.windows_px, *left_grey.shape)
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
                truncation_px=max(p.truncation_px, p.robust_truncation_px),
                scratch=self._scratch,
            )
            contrast = contrasts(oriented, p.truncation_px)
            foveal = foveal_contrast(oriented, p.truncation_px, p.foveal_sigma_px)
            robust_left, robust_right = robust_distances(oriented, p.robust_truncation_px, p.robust_sigma_px)
        rank = np.argsort(np.argsort([window.size_px for window in windows]))  # oriented values are sorted by size
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
