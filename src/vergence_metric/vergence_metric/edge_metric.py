"""The edge metric of a stereo pair in one call: what the node and `vergence measure` share."""

import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vergence_metric.edge_distance import EdgeDistances, edge_distances
from vergence_metric.edge_parameters import EdgeMetricParameters
from vergence_metric.edges import Edges, Grey, ImageShapeError, detect_edges, to_grey
from vergence_metric.nearest_edges import NearestEdges
from vergence_metric.windows import Window, centre_windows


@dataclass(frozen=True)
class EdgeMetricResult:
    """Everything measured on one pair; element i of each array belongs to `windows[i]`.

    `left_grey` and `right_grey` (h, w) uint8 are what was compared: the right one is already aligned. `stage_s` holds
    the seconds each stage took.
    """

    windows: tuple[Window, ...]
    left_grey: Grey
    right_grey: Grey
    left_edges: Edges
    right_edges: Edges
    distances: EdgeDistances
    stage_s: dict[str, float] = field(default_factory=dict)

    @property
    def windows_px(self) -> NDArray[np.uint32]:
        """Sides of the windows as asked for [px]."""
        return np.array([window.size_px for window in self.windows], np.uint32)

    @property
    def left_to_right_px(self) -> NDArray[np.float64]:
        """The paper's metric over left edge pixels [px]."""
        return self.distances.left_to_right_px

    @property
    def right_to_left_px(self) -> NDArray[np.float64]:
        """The paper's metric over right edge pixels [px]."""
        return self.distances.right_to_left_px

    @property
    def status(self) -> NDArray[np.uint8]:
        """WindowStatus of each window."""
        return self.distances.status


class EdgeMetric:
    """Measures pair after pair; keeps only what alignment filters over time."""

    def __init__(self, parameters: EdgeMetricParameters) -> None:
        self.parameters = parameters

    def measure(self, left: NDArray[Any], right: NDArray[Any]) -> EdgeMetricResult:
        """Measure a pair of (h, w, 3) BGR or (h, w) grey uint8 images of one size.

        Raises ImageShapeError where the images are not, or differ in size.
        """
        if left.shape[:2] != right.shape[:2]:
            raise ImageShapeError(f"left image is {left.shape[:2]}, right is {right.shape[:2]}: they must be alike")
        started = time.perf_counter()
        left_grey, right_grey = to_grey(left), to_grey(right)
        left_edges = detect_edges(left_grey, self.parameters)
        right_edges = detect_edges(right_grey, self.parameters)
        edges_done = time.perf_counter()
        windows = centre_windows(self.parameters.windows_px, *left_grey.shape)
        distances = edge_distances(NearestEdges(left_edges.mask, right_edges.mask, windows))
        stage_s = {"edges": edges_done - started, "distance": time.perf_counter() - edges_done}
        return EdgeMetricResult(windows, left_grey, right_grey, left_edges, right_edges, distances, stage_s)
