"""The edge metric of a stereo pair in one call, for the node and `vergence measure`."""

import math
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vergence_metric.alignment.alignment import Aligner, Alignment
from vergence_metric.alignment.parameters import AlignmentParameters
from vergence_metric.disparity.protocol import Surface
from vergence_metric.edges.chance import ChanceLevels, chance_levels
from vergence_metric.edges.contrast import (
    Contrasts,
    WindowContrast,
    contrasts,
    foveal_contrast,
    least_contrast,
    small_windows,
    surface_contrast,
)
from vergence_metric.edges.edge_detector import EdgeDetector
from vergence_metric.edges.edge_distance import EdgeDistances, edge_distances
from vergence_metric.edges.edges import Edges, Grey, ImageShapeError, Thresholds, detect_edges, to_grey
from vergence_metric.edges.nearest_edges import NearestEdges
from vergence_metric.edges.oriented_edges import OrientedField, oriented_field
from vergence_metric.edges.parameters import ContrastParameters, EdgeParameters
from vergence_metric.edges.robust import robust_distances
from vergence_metric.edges.scratch import Scratch
from vergence_metric.edges.windows import Window, centre_windows, hull

Values = NDArray[np.float64]

_EDGE_REACH_PX = 32  # around the small windows: weak edges are followed so far to strong ones


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
    the names of vergence_msgs/EdgeVergence; values are float64, NaN where `status` (WindowStatus) gives a reason. Only
    `least_contrast`, that of the small windows, is measured at once; everything else is measured when it is read.
    `thresholds` are Canny's for the left and the right image, `stage_s` is the duration of each stage so far [s].
    """

    windows: tuple[Window, ...]
    alignment: Alignment
    left_grey: Grey
    right_grey: Grey
    least_contrast: WindowContrast
    edge_parameters: EdgeParameters
    contrast_parameters: ContrastParameters
    thresholds: tuple[Thresholds, Thresholds]
    stage_s: dict[str, float]
    small_field: OrientedField
    small_origin_px: tuple[int, int]

    def target_contrast(self, surface: Surface | None) -> WindowContrast:
        """Return the least contrast of the small windows, or that of a target's surface where it is less.

        Only until the next pair is measured.
        """
        least = self.least_contrast
        if surface is None or not math.isfinite(least.contrast):
            return least
        corner = (surface.origin_px[0] - self.small_origin_px[0], surface.origin_px[1] - self.small_origin_px[1])
        own = surface_contrast(self.small_field, self.contrast_parameters.truncation_px, surface.support, corner)
        return replace(least, contrast=own) if own < least.contrast else least

    @cached_property
    def left_edges(self) -> Edges:
        """Edges of the whole left image."""
        with _timed(self.stage_s, "left_edges"):
            return detect_edges(self.left_grey, self.edge_parameters, self.thresholds[0])

    @cached_property
    def right_edges(self) -> Edges:
        """Edges of the whole right image."""
        with _timed(self.stage_s, "right_edges"):
            return detect_edges(self.right_grey, self.edge_parameters, self.thresholds[1])

    @property
    def windows_px(self) -> NDArray[np.uint32]:
        """Requested sides of the windows [px]."""
        return np.array([window.size_px for window in self.windows], np.uint32)

    @property
    def left_to_right_px(self) -> Values:
        """Mean distance from the left edge pixels to the nearest right ones."""
        return self._distances.left_to_right_px

    @property
    def right_to_left_px(self) -> Values:
        """Mean distance from the right edge pixels to the nearest left ones."""
        return self._distances.right_to_left_px

    @property
    def left_edge_count(self) -> NDArray[np.int64]:
        """Edge pixels of the left image."""
        return self._distances.left_count

    @property
    def right_edge_count(self) -> NDArray[np.int64]:
        """Edge pixels of the right image."""
        return self._distances.right_count

    @property
    def status(self) -> NDArray[np.uint8]:
        """WindowStatus of each window."""
        return self._distances.status

    @property
    def chance_left_to_right_px(self) -> Values:
        """What `left_to_right_px` would be if the images were unrelated."""
        return self._chance.left_to_right_px

    @property
    def chance_right_to_left_px(self) -> Values:
        """What `right_to_left_px` would be if the images were unrelated."""
        return self._chance.right_to_left_px

    @property
    def contrast_left_to_right(self) -> Values:
        """Contrast with chance, from the left edge pixels to the right ones."""
        return self._contrasts.left_to_right[self._rank]

    @property
    def contrast_right_to_left(self) -> Values:
        """Contrast with chance, from the right edge pixels to the left ones."""
        return self._contrasts.right_to_left[self._rank]

    @property
    def contrast(self) -> Values:
        """Mean of both directions' contrasts."""
        return self._contrasts.both[self._rank]

    @property
    def foveal_contrast(self) -> float:
        """Contrast at the fovea: edge pixels weigh less with their distance from the centre, by a Gaussian."""
        p = self.contrast_parameters
        return foveal_contrast(self._oriented, p.truncation_px, p.foveal_sigma_px)

    @property
    def robust_left_to_right_px(self) -> Values:
        """Robust form of `left_to_right_px`."""
        return self._robust[0][self._rank]

    @property
    def robust_right_to_left_px(self) -> Values:
        """Robust form of `right_to_left_px`."""
        return self._robust[1][self._rank]

    @property
    def _rank(self) -> NDArray[np.intp]:
        """The place of each window among the windows sorted by size, as oriented values are."""
        return np.argsort(np.argsort([window.size_px for window in self.windows]))

    @cached_property
    def _nearest(self) -> NearestEdges:
        return NearestEdges(self.left_edges.mask, self.right_edges.mask, self.windows)

    @cached_property
    def _distances(self) -> EdgeDistances:
        with _timed(self.stage_s, "distance"):
            return edge_distances(self._nearest)

    @cached_property
    def _chance(self) -> ChanceLevels:
        with _timed(self.stage_s, "chance"):
            return chance_levels(self._nearest)

    @cached_property
    def _oriented(self) -> OrientedField:
        p = self.contrast_parameters
        truncation_px = max(p.truncation_px, p.robust_truncation_px)
        return _oriented_field(self.left_edges, self.right_edges, self.windows, p, truncation_px)

    @cached_property
    def _contrasts(self) -> Contrasts:
        with _timed(self.stage_s, "contrasts"):
            return contrasts(self._oriented, self.contrast_parameters.truncation_px)

    @cached_property
    def _robust(self) -> tuple[Values, Values]:
        p = self.contrast_parameters
        with _timed(self.stage_s, "robust"):
            return robust_distances(self._oriented, p.robust_truncation_px, p.robust_sigma_px)


class EdgeMetric:
    """Measures successive pairs, on one thread; its state is the alignment and the edges' thresholds."""

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
        self._detectors = (EdgeDetector(self._edges), EdgeDetector(self._edges))
        self._scratch = Scratch()

    def measure(self, left: NDArray[Any], right: NDArray[Any], seen_px: int | None = None) -> EdgeMetricResult:
        """Measure a pair of (h, w, 3) BGR or (h, w) grey uint8 images of one size.

        Windows are cut to the centre square of side `seen_px`; None for the whole image. Raises ImageShapeError where
        the images are not such, or differ in size.
        """
        return self.measure_aligned(self.align(left, right), seen_px)

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

    def measure_aligned(self, pair: AlignedPair, seen_px: int | None = None) -> EdgeMetricResult:
        """Measure a pair that `align` has returned; see `measure`."""
        p, stage_s = self._contrast, dict(pair.stage_s)
        height, width = pair.left_grey.shape
        windows = centre_windows(self._edges.windows_px, height, width, seen_px)
        small = small_windows(windows)
        outer = hull(small)
        area = (
            slice(max(outer.top - _EDGE_REACH_PX, 0), min(outer.bottom + _EDGE_REACH_PX, height)),
            slice(max(outer.left - _EDGE_REACH_PX, 0), min(outer.right + _EDGE_REACH_PX, width)),
        )
        with _timed(stage_s, "edges"):
            images = (pair.left_grey, pair.right_grey)
            left, right = (
                detector.detect_within(grey, area) for detector, grey in zip(self._detectors, images, strict=True)
            )
        with _timed(stage_s, "contrast"):
            there = [window.shifted(area[0].start, area[1].start) for window in small]
            oriented = _oriented_field(left, right, there, p, p.truncation_px, self._scratch)
            least = least_contrast(oriented, p.truncation_px)
        thresholds = (left.low, left.high), (right.low, right.high)
        field, origin_px = oriented, (outer.left, outer.top)
        return EdgeMetricResult(
            windows, pair.alignment, *images, least, self._edges, p, thresholds, stage_s, field, origin_px
        )


def _oriented_field(
    left: Edges,
    right: Edges,
    windows: Sequence[Window],
    parameters: ContrastParameters,
    truncation_px: int,
    scratch: Scratch | None = None,
) -> OrientedField:
    bins, signed = parameters.orientation_bins, parameters.orientation_signed
    return oriented_field(left, right, windows, bins=bins, signed=signed, truncation_px=truncation_px, scratch=scratch)


@contextmanager
def _timed(stage_s: dict[str, float], name: str) -> Iterator[None]:
    started = time.perf_counter()
    yield
    stage_s[name] = time.perf_counter() - started
