"""The table that the paper prints of a pair of images: shapes, both directions per window, and the two lists."""

import math
from collections.abc import Iterable

from vergence_bringup.figures.pictures import Image
from vergence_metric.measurement.edge_metric import EdgeMetricResult


def paper_lines(left: Image, right: Image, result: EdgeMetricResult) -> list[str]:
    """Return the lines for a pair of (h, w, 3) images and its metric I, as in Fig. 12 of the paper [px].

    Per window: the shapes of what is compared, the mean distance from the left edge pixels to the nearest right ones,
    and back; at the end the list of the former and that of the latter.
    """
    lines = [f"images {left.shape} {right.shape}, edges {result.left_edges.mask.shape} {result.right_edges.mask.shape}"]
    there, back = list(result.left_to_right_px), list(result.right_to_left_px)
    for window, left_to_right, right_to_left in zip(result.windows, there, back, strict=True):
        shape = (window.bottom - window.top, window.right - window.left)
        lines += [
            f"{window.size_px}x{window.size_px}: shapes {shape} {shape}",
            f"  left to right {_figure(left_to_right)}",
            f"  right to left {_figure(right_to_left)}",
        ]
    return [*lines, f"left to right: {_list(there)}", f"right to left: {_list(back)}"]


def _list(values: Iterable[float]) -> str:
    return f"[{', '.join(map(_figure, values))}]"


def _figure(value: float) -> str:
    return f"{value:.4f}" if math.isfinite(value) else "no edges"
