"""Detectors in ONNX files whose answers are known by construction, in the output layouts of the families' exporters.

A cell of 16 px that is red is an object of class 0, a green one of class 1, with the cell's mean as score; further
classes are never seen. YuNet finds its faces in red cells. All other cells have boxes at random and score nothing, as a
network's background has. The network for itself is not trained: only its output looks like the family's.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from onnx import TensorProto, helper

from vergence_metric.testing import onnx_grids as grids
from vergence_metric.testing.onnx_graph import SEED, Array, Cells, Graph, Outputs, make_cells, save_model
from vergence_metric.testing.onnx_grids import rows

_TOP = 10
_DETR_ROWS = 300


def build_detector(
    path: Path,
    layout: str,
    size_px: tuple[int, int] = (128, 96),
    classes: int = 2,
    names: str | None = None,
    declared: list[int | str] | None = None,
    metadata: dict[str, str] | None = None,
    fixed: bool = True,
    renamed: str | None = None,
) -> Path:
    """Write a model and return its path.

    Args:
        path: of the file.
        layout: one of LAYOUTS.
        size_px: (width, height) of its input.
        classes: number of classes.
        names: metadata entry of that name.
        declared: shape that the file declares for its outputs; None for none.
        metadata: further entries.
        fixed: whether the input accepts no other size.
        renamed: name of the only output, None for the exporter's.

    """
    graph = Graph()
    if layout == "yunet":
        graph.source = "input"  # OpenCV looks for this name
        graph.node("Identity", [graph.source], "images")
    bgr_bytes = layout in ("yolox", "yolox_decoded", "yunet")
    outputs = _LAYOUTS[layout](graph, make_cells(graph, size_px, classes, bgr_bytes))
    if renamed is not None:
        graph.node("Identity", [outputs[0][0]], renamed)
        outputs = [(renamed, outputs[0][1])]
    width, height = size_px
    shape: list[int | str] = [1, 3, height, width] if fixed else [1, 3, "height", "width"]
    save_model(path, graph, outputs, shape, declared, {**(metadata or {}), "names": names or ""})
    return path


def constant_detector(
    path: Path, *outputs: Array, size_px: tuple[int, int] = (128, 96), names: tuple[str, ...] = (), task: str = ""
) -> Path:
    """Write a model that always gives the same outputs, by default named output0, output1, ..., and return its path."""
    graph, called = Graph(), names or tuple(f"output{i}" for i in range(len(outputs)))
    graph.node("ReduceMean", ["images"], "mean", keepdims=0)
    nothing = graph.node("Mul", ["mean", graph.constant("zero", np.array(0.0, np.float32))], "nothing")
    for name, output in zip(called, outputs, strict=True):
        graph.node("Add", [graph.constant(f"constant_{name}", output.astype(np.float32)), nothing], name)
    save_model(
        path,
        graph,
        [(name, TensorProto.FLOAT) for name in called],
        [1, 3, size_px[1], size_px[0]],
        None,
        {"task": task},
    )
    return path


def _best(graph: Graph, cells: Cells) -> tuple[str, str, str]:
    """Return names of the best rows' corners (1, K, 4), scores (1, K) and classes (1, K) as floats."""
    corners = graph.constant("corners", cells.corners)
    best = graph.node("ReduceMax", [cells.scores], "best", axes=[2], keepdims=0)
    ids = graph.node("ArgMax", [cells.scores], "ids", axis=2, keepdims=0)
    count = graph.constant("top", np.array([_TOP]))
    graph.nodes.append(helper.make_node("TopK", [best, count], ["top_scores", "top_rows"], axis=1))
    rows = graph.node("Squeeze", ["top_rows", graph.constant("first", np.array([0]))], "chosen")
    chosen = graph.node("Gather", [corners, rows], "top_boxes", axis=0)
    batched = graph.node("Unsqueeze", [chosen, "first"], "boxes_batched")
    top_ids = graph.node("GatherElements", [ids, "top_rows"], "top_ids", axis=1)
    return batched, "top_scores", graph.node("Cast", [top_ids], "ids_float", to=TensorProto.FLOAT)


def _yolov10(graph: Graph, cells: Cells) -> Outputs:
    corners, best, ids = _best(graph, cells)
    last = graph.constant("last", np.array([2]))
    columns = [corners, *(graph.node("Unsqueeze", [name, last], f"{name}_column") for name in (best, ids))]
    graph.node("Concat", columns, "output0", axis=2)
    return [("output0", TensorProto.FLOAT)]


def _end_to_end(graph: Graph, cells: Cells) -> Outputs:
    corners, best, ids = _best(graph, cells)
    sure = graph.node("Greater", [best, graph.constant("half", np.array(0.5, np.float32))], "sure")
    whole = graph.node("Cast", [sure], "sure_whole", to=TensorProto.INT32)
    graph.node("ReduceSum", [whole, graph.constant("along", np.array([1]))], "num_dets", keepdims=1)
    graph.node("Identity", [corners], "det_boxes")
    graph.node("Identity", [best], "det_scores")
    graph.node("Cast", [ids], "det_classes", to=TensorProto.INT32)
    kinds = (TensorProto.INT32, TensorProto.FLOAT, TensorProto.FLOAT, TensorProto.INT32)
    return list(zip(("num_dets", "det_boxes", "det_scores", "det_classes"), kinds, strict=True))


def _kept(graph: Graph, cells: Cells, order: tuple[str, ...], name: str) -> Outputs:
    """Rows of the columns in order; their number is how many the NonMaxSuppression operator keeps."""
    place = graph.constant("corners", cells.corners[None])
    columns = graph.node("Transpose", [cells.scores], "columns", perm=[0, 2, 1])
    limits = [
        graph.constant("most", np.array([_TOP])),
        graph.constant("overlap", np.array([0.5], np.float32)),
        graph.constant("least", np.array([0.5], np.float32)),
    ]
    kept = graph.node("NonMaxSuppression", [place, columns, *limits], "kept")
    parts = {}
    for number, part in enumerate(("batch", "class", "row")):
        index = graph.constant(f"take_{part}", np.array([number]))
        parts[part] = graph.node("Gather", [kept, index], f"kept_{part}", axis=1)
    row = graph.node("Reshape", [parts.pop("row"), graph.constant("all", np.array([-1]))], "row_flat")
    floats = {part: graph.node("Cast", [one], f"{one}_float", to=TensorProto.FLOAT) for part, one in parts.items()}
    floats["corners"] = graph.node("Gather", [graph.constant("corners_flat", cells.corners), row], "kept_boxes", axis=0)
    best = graph.node("GatherND", [columns, kept], "kept_scores")
    floats["score"] = graph.node("Unsqueeze", [best, graph.constant("one", np.array([1]))], "kept_score")
    graph.node("Concat", [floats[part] for part in order], name, axis=1)
    return [(name, TensorProto.FLOAT)]


def _ort(graph: Graph, cells: Cells) -> Outputs:
    return _kept(graph, cells, ("batch", "corners", "class", "score"), "outputs")


def _nas_flat(graph: Graph, cells: Cells) -> Outputs:
    return _kept(graph, cells, ("batch", "corners", "score", "class"), "graph2_flat_predictions")


def _rt_detr(graph: Graph, cells: Cells) -> Outputs:
    """`[1, 300, 4 + classes]`: centres and sizes from 0 to 1."""
    rng = np.random.default_rng(SEED)
    boxes = graph.constant("shares", rng.uniform(0.1, 0.6, (1, _DETR_ROWS, 4)).astype(np.float32))
    rows = graph.constant("some", rng.integers(0, len(cells.boxes), _DETR_ROWS))
    scores = graph.node("Gather", [cells.scores, rows], "chosen_scores", axis=1)
    noise = graph.constant("noise", rng.uniform(0.0, 0.1, (1, _DETR_ROWS, 1)).astype(np.float32))
    graph.node("Concat", [boxes, graph.node("Add", [scores, noise], "noisy")], "output0", axis=2)
    return [("output0", TensorProto.FLOAT)]


def _logits(graph: Graph, cells: Cells) -> Outputs:
    """Rows as of YOLOv6, but with scores that no sigmoid has been through, as NanoDet and others have them."""
    ones = np.ones((len(cells.boxes), 1))
    plain = rows(graph, cells, cells.boxes, ones)
    width = 5
    head = graph.node("Slice", [plain, *_slice(graph, "head", 0, width)], "head")
    tail = graph.node("Slice", [plain, *_slice(graph, "tail", width, 2**31 - 1)], "tail")
    shifted = graph.node("Sub", [tail, graph.constant("four", np.array(4.0, np.float32))], "shifted")
    graph.node("Concat", [head, shifted], "outputs", axis=2)
    return [("outputs", TensorProto.FLOAT)]


def _slice(graph: Graph, name: str, start: int, end: int) -> list[str]:
    values = {"start": start, "end": end, "axis": 2}
    return [graph.constant(f"{name}_{part}", np.array([value])) for part, value in values.items()]


_LAYOUTS: dict[str, Callable[[Graph, Cells], Outputs]] = {
    "yolov5": grids.yolov5,
    "yolov6": grids.yolov6,
    "yolov7": grids.yolov7,
    "yolov8": grids.yolov8,
    "yolov9": grids.yolov9,
    "yolov10": _yolov10,
    "yolox": grids.yolox,
    "yolox_decoded": grids.yolox_decoded,
    "yolov8_rows": grids.yolov8_rows,
    "end_to_end": _end_to_end,
    "ort": _ort,
    "nas_flat": _nas_flat,
    "rt_detr": _rt_detr,
    "logits": _logits,
    "yunet": grids.yunet,
}

LAYOUTS = tuple(_LAYOUTS)
"""What can be built: the families' own exports, and three that no registered layout explains."""
