"""`vergence measure`: the paper's flowchart on two stored images."""

import argparse
import json
import math
import sys
from collections.abc import Iterable
from pathlib import Path

from vergence_bringup.pictures import combined_edges, read_image, write_image
from vergence_metric.edge_metric import EdgeMetric
from vergence_metric.edge_parameters import EdgeMetricParameters


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of the subcommand."""
    parser.add_argument("left", type=Path, metavar="LEFT", help="the left eye's image")
    parser.add_argument("right", type=Path, metavar="RIGHT", help="the right eye's image, of the same size")
    parser.add_argument(
        "--out", type=Path, metavar="DIR", help="write left_edges.png, right_edges.png, combined_edges.png"
    )
    parser.add_argument("--json", action="store_true", help="one JSON object on standard output instead of the table")
    parser.add_argument("--windows", type=int, nargs="+", metavar="PX", help="sides of the centre windows in px")
    parser.add_argument(
        "--align",
        choices=("none", "auto"),
        default="none",
        help="none: exactly the paper; auto: take vertical offset and roll out of the right image first",
    )


def run(options: argparse.Namespace) -> int:
    """Measure one pair, print it and write its edge images."""
    parameters = EdgeMetricParameters().replaced(align=options.align)
    if options.windows:
        parameters = parameters.replaced(windows_px=tuple(options.windows))
    left, right = read_image(options.left), read_image(options.right)
    result = EdgeMetric(parameters).measure(left, right)
    if options.out is not None:
        write_image(options.out / "left_edges.png", result.left_edges.mask)
        write_image(options.out / "right_edges.png", result.right_edges.mask)
        write_image(options.out / "combined_edges.png", combined_edges(result.left_edges.mask, result.right_edges.mask))
    figures = {
        "windows_px": [int(size) for size in result.windows_px],
        "left_to_right_px": _numbers(result.left_to_right_px),
        "right_to_left_px": _numbers(result.right_to_left_px),
        "contrast": _numbers(result.contrast),
    }
    if options.json:
        json.dump(figures, sys.stdout, allow_nan=False)
        print()
        return 0
    print(f"{'window':>9}  {'left to right':>13}  {'right to left':>13}  {'contrast':>8}")
    for size, left_to_right, right_to_left, contrast in zip(*figures.values(), strict=True):
        row = (_text(left_to_right, " px"), _text(right_to_left, " px"), _text(contrast, ""))
        print(f"{f'{size}x{size}':>9}  {row[0]:>13}  {row[1]:>13}  {row[2]:>8}")
    if options.out is not None:
        print(f"edge images: {options.out}")
    return 0


def _numbers(values: Iterable[float]) -> list[float | None]:
    return [float(value) if math.isfinite(value) else None for value in values]


def _text(value: float | None, unit: str) -> str:
    return "no edges" if value is None else f"{value:.2f}{unit}"
