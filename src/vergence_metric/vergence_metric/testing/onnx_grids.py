"""Outputs of detectors with a row for each cell of a grid: YOLOv5 to YOLOv9, YOLOX and YuNet."""

import numpy as np
from onnx import TensorProto

from vergence_metric.testing.onnx_graph import ANSWERING, SEED, STRIDES, Array, Cells, Graph, Outputs

FACE_SIDES = (2.0, 2.5)
"""Width and height of YuNet's faces in strides; their middle is the cell's."""

FACE_POINTS = ((0.1, 0.2), (0.9, 0.2), (0.5, 0.6), (0.2, 1.1), (0.8, 1.1))
"""Their landmarks from the cell's corner, in strides."""


def rows(graph: Graph, cells: Cells, boxes: Array, objectness: Array | None) -> str:
    """Return the name of the rows (1, N, columns): boxes, the objectness if there is one, scores."""
    place = boxes if objectness is None else np.hstack([boxes, objectness])
    return graph.node("Concat", [graph.constant("place", place.astype(np.float32)[None]), cells.scores], "rows", axis=2)


def yolov6(graph: Graph, cells: Cells) -> Outputs:
    """One row a cell, the objectness 1 throughout."""
    ones = np.ones((len(cells.boxes), 1))
    graph.node("Identity", [rows(graph, cells, cells.boxes, ones)], "outputs")
    return [("outputs", TensorProto.FLOAT)]


def _anchors(graph: Graph, cells: Cells, name: str) -> Outputs:
    """Three rows a cell, stride by stride, and the maps of each stride before decoding."""
    every, maps = rows(graph, cells, cells.boxes, cells.objectness), []
    parts = []
    for stride in STRIDES:
        places = np.flatnonzero(cells.strides == stride)
        part = graph.node("Gather", [every, graph.constant(f"rows{stride}", places)], f"rows_{stride}", axis=1)
        parts += [part] * 3
    graph.node("Concat", parts, name, axis=1)
    for stride in STRIDES:
        # A map (1, 3, h, w, columns) of zeros of the stride's grid.
        pooled = graph.node(
            "Mul", [f"pool{stride}", graph.constant("none", np.array(0.0, np.float32))], f"void{stride}"
        )
        maps.append(graph.node("Unsqueeze", [pooled, graph.constant("last", np.array([4]))], f"map{stride}"))
    return [(name, TensorProto.FLOAT), *((one, TensorProto.FLOAT) for one in maps)]


def yolov5(graph: Graph, cells: Cells) -> Outputs:
    """Three rows a cell."""
    return _anchors(graph, cells, "output0")[:1]


def yolov7(graph: Graph, cells: Cells) -> Outputs:
    """As YOLOv5, and the maps of each stride before decoding."""
    return _anchors(graph, cells, "output")


def _columns(graph: Graph, cells: Cells, name: str, boxes: Array) -> str:
    place = graph.constant(f"place_{name}", boxes.T[None].astype(np.float32).copy())
    columns = graph.node("Transpose", [cells.scores], f"columns_{name}", perm=[0, 2, 1])
    return graph.node("Concat", [place, columns], name, axis=1)


def yolov8(graph: Graph, cells: Cells) -> Outputs:
    """Columns of box and scores."""
    return [(_columns(graph, cells, "output0", cells.boxes), TensorProto.FLOAT)]


def yolov9(graph: Graph, cells: Cells) -> Outputs:
    """The auxiliary branch, whose boxes are worse, and the main one."""
    auxiliary = _columns(graph, cells, "output0", cells.boxes + np.array([5.0, 5.0, 0.0, 0.0]))
    return [(auxiliary, TensorProto.FLOAT), (_columns(graph, cells, "1530", cells.boxes), TensorProto.FLOAT)]


def yolov8_rows(graph: Graph, cells: Cells) -> Outputs:
    """As YOLOv8, transposed."""
    graph.node("Identity", [rows(graph, cells, cells.boxes, None)], "output0")
    return [("output0", TensorProto.FLOAT)]


def yolox(graph: Graph, cells: Cells) -> Outputs:
    """Rows of offsets, logarithms of sizes, objectness and scores."""
    stride = cells.strides[:, None]
    raw = np.hstack([cells.boxes[:, :2] / stride - cells.places, np.log(cells.boxes[:, 2:] / stride)])
    graph.node("Identity", [rows(graph, cells, raw, cells.objectness)], "output")
    return [("output", TensorProto.FLOAT)]


def yolox_decoded(graph: Graph, cells: Cells) -> Outputs:
    """Rows of boxes in pixels, objectness and scores."""
    graph.node("Identity", [rows(graph, cells, cells.boxes, cells.objectness)], "output")
    return [("output", TensorProto.FLOAT)]


def yunet(graph: Graph, cells: Cells) -> Outputs:
    """Faces about the red cells."""
    rng = np.random.default_rng(SEED)
    outputs = []
    for stride in STRIDES:
        places = np.flatnonzero(cells.strides == stride)
        red = graph.node("Gather", [cells.scores, graph.constant(f"rows{stride}", places)], f"red_{stride}", axis=1)
        red = graph.node("Gather", [red, graph.constant("class0", np.array([0]))], f"red0_{stride}", axis=2)
        for part in ("cls", "obj"):
            outputs.append(graph.node("Identity", [red], f"{part}_{stride}"))
        boxes, points = rng.normal(0.5, 0.5, (len(places), 4)), rng.normal(0.5, 0.5, (len(places), 10))
        if stride == ANSWERING:
            boxes[:] = [0.5, 0.5, *np.log(FACE_SIDES)]
            points[:] = np.ravel(FACE_POINTS)
        # Added to zeros that depend on the image: an output must be computed.
        for part, value in (("bbox", boxes), ("kps", points)):
            nothing = graph.node(
                "Mul", [red, graph.constant("zero", np.array(0.0, np.float32))], f"nothing_{part}_{stride}"
            )
            known = graph.constant(f"known_{part}_{stride}", value.astype(np.float32)[None])
            outputs.append(graph.node("Add", [nothing, known], f"{part}_{stride}"))
    return [(name, TensorProto.FLOAT) for name in outputs]
