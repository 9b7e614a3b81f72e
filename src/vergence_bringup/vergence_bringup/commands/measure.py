"""`vergence measure`: metric I of two stored images as in the paper's flowchart, and metric II with a detector."""

import argparse
import importlib.util
import json
import math
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from vergence_bringup.commands.paper_table import paper_lines
from vergence_bringup.figures.boxes import BoxFigures, corner_text, signed
from vergence_bringup.figures.pictures import Image, combined_edges, read_image, write_image
from vergence_metric.alignment.parameters import AlignmentParameters
from vergence_metric.edges.parameters import EdgeParameters
from vergence_metric.measurement.edge_metric import EdgeMetric
from vergence_rig.install_hint import install_hint
from vergence_rig.regular_file import expanded

SHIPPED = "shipped"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of the subcommand."""
    parser.add_argument("left", type=expanded, metavar="LEFT", help="image of the left eye")
    parser.add_argument("right", type=expanded, metavar="RIGHT", help="image of the right eye, of the same size")
    parser.add_argument(
        "--out",
        type=expanded,
        metavar="DIR",
        help="write left_edges.png, right_edges.png, combined_edges.png and, with --model, boxes.png",
    )
    parser.add_argument(
        "--model",
        metavar="FILE",
        help=f"add metric II with this ONNX detector; {SHIPPED!r} is the one for Rubik's cubes in this package",
    )
    parser.add_argument(
        "--paper",
        action="store_true",
        help="print the paper's own table, line for line as its Fig. 12, find the boxes with the shipped detector "
        "unless --model names another, and save left.png and right.png too, in the folder paper without --out",
    )
    parser.add_argument(
        "--layout", metavar="NAME", help="layout of the detector's outputs (default: recognised by a run)"
    )
    parser.add_argument(
        "--labels",
        metavar="FILE",
        help="file of the detector's class names, or coco (default: those in the model, COCO's for 80 classes)",
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object instead of the table")
    parser.add_argument("--windows", type=int, nargs="+", metavar="PX", help="sides of the centre windows in px")
    parser.add_argument(
        "--align",
        choices=("none", "auto"),
        default="none",
        help="none: exactly the paper; auto: correct vertical offset and roll of the right image first",
    )


def run(options: argparse.Namespace) -> int:
    """Measure one pair, print the result and write its images."""
    edges = EdgeParameters(windows_px=tuple(options.windows)) if options.windows else EdgeParameters()
    left, right = read_image(options.left), read_image(options.right)
    out, model = options.out, options.model
    if options.paper:
        if options.json:
            raise ValueError("--paper and --json must not be given together: both say what is printed")
        out = out or Path("paper")
        if model is None and importlib.util.find_spec("onnxruntime") is not None:
            model = SHIPPED
        for name, picture in (("left", left), ("right", right)):
            write_image(out / f"{name}.png", picture)
    result = EdgeMetric(edges, alignment=AlignmentParameters(mode=options.align)).measure(left, right)
    if out is not None:
        write_image(out / "left_edges.png", result.left_edges.mask)
        write_image(out / "right_edges.png", result.right_edges.mask)
        write_image(out / "combined_edges.png", combined_edges(result.left_edges.mask, result.right_edges.mask))
    # Before anything is printed, so that an unusable model gives one line of output.
    boxes = _boxes(left, right, argparse.Namespace(**vars(options) | {"model": model, "out": out}))
    figures: dict[str, list[Any]] = {
        "windows_px": [int(size) for size in result.windows_px],
        "left_to_right_px": _numbers(result.left_to_right_px),
        "right_to_left_px": _numbers(result.right_to_left_px),
        "contrast": _numbers(result.contrast),
    }
    if options.json:
        json.dump(figures if boxes is None else {**figures, "box": boxes.as_json()}, sys.stdout, allow_nan=False)
        print()
        return 0
    if options.paper:
        print("\n".join(paper_lines(left, right, result)))
    else:
        _print_table(figures)
    if boxes is not None:
        _print_boxes(boxes)
    elif options.paper:
        print(f"\nno boxes: onnxruntime is not installed ({install_hint('onnxruntime')})")
    if out is not None:
        print(f"images: {out}")
    return 0


def _print_table(figures: Mapping[str, Sequence[Any]]) -> None:
    print(f"{'window':>9}  {'left to right':>13}  {'right to left':>13}  {'contrast':>8}")
    for size, left_to_right, right_to_left, contrast in zip(*figures.values(), strict=True):
        row = (_text(left_to_right, " px"), _text(right_to_left, " px"), _text(contrast, ""))
        print(f"{f'{size}x{size}':>9}  {row[0]:>13}  {row[1]:>13}  {row[2]:>8}")


def _boxes(left: Image, right: Image, options: argparse.Namespace) -> BoxFigures | None:
    """Return metric II of both images, None without a detector."""
    changes = {name: getattr(options, name) for name in ("layout", "labels") if getattr(options, name) is not None}
    if options.model is None:
        if changes:
            raise ValueError(f"--{next(iter(changes))} needs --model FILE, whose outputs it describes")
        return None
    # Imported late: onnxruntime is needed for this alone.
    from vergence_metric.boxes import draw, measure_pair
    from vergence_metric.boxes.parameters import BoxMetricParameters, DetectorParameters

    if not options.model:
        raise ValueError(f"--model must be the path of an ONNX file, or {SHIPPED}: got an empty string")
    parameters = BoxMetricParameters(detector=DetectorParameters().replaced(**changes))
    result = measure_pair(left, right, "" if options.model == SHIPPED else options.model, parameters)
    if options.out is not None:
        write_image(options.out / "boxes.png", draw(left, right, result))
    return BoxFigures.from_result(result)


def _print_boxes(boxes: BoxFigures) -> None:
    reason = f" ({boxes.reason})" if boxes.reason else ""
    print(f"\nboxes: {boxes.seen}{reason}, scores {_score(boxes.scores[0])} left, {_score(boxes.scores[1])} right")
    if not any(math.isfinite(value) for value in boxes.left_minus_right_px):
        return
    print(f"{'corners':>9}  {'top left, bottom right, in px':>34}")
    print(f"{'L - R':>9}  {corner_text(boxes.left_minus_right_px):>34}")
    print(f"{'R - L':>9}  {corner_text(boxes.right_minus_left_px):>34}")
    center, refined = signed(boxes.center_px[0]), signed(boxes.refined_px[0])
    print(f"disparity of the boxes' centres {center} px, of the surface inside them {refined} px")


def _score(value: float) -> str:
    return f"{value:.2f}" if math.isfinite(value) else "-"


def _numbers(values: Iterable[float]) -> list[float | None]:
    return [float(value) if math.isfinite(value) else None for value in values]


def _text(value: float | None, unit: str) -> str:
    return "no edges" if value is None else f"{value:.2f}{unit}"
