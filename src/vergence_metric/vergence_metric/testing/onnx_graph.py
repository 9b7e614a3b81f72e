"""Nodes and constants of an ONNX model in the making, and the cells of a detector's grid."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from onnx import NodeProto, TensorProto, helper, numpy_helper, save

STRIDES = (8, 16, 32)
ANSWERING = 16
"""The stride whose cells see objects."""

SEED = 21

Outputs = list[tuple[str, int]]
Array = NDArray[Any]


@dataclass
class Graph:
    """Nodes and constants of a model in the making."""

    nodes: list[NodeProto] = field(default_factory=list)
    constants: list[TensorProto] = field(default_factory=list)
    source: str = "images"

    def constant(self, name: str, value: Array) -> str:
        """Add a constant, unless there is one of this name, and return the name."""
        if name not in [tensor.name for tensor in self.constants]:
            self.constants.append(numpy_helper.from_array(value, name))
        return name

    def node(self, kind: str, inputs: list[str], output: str, **attributes: Any) -> str:
        """Add a node with one output and return the output's name."""
        self.nodes.append(helper.make_node(kind, inputs, [output], **attributes))
        return output


@dataclass(frozen=True)
class Cells:
    """All strides' cells: the name of their scores (1, N, classes), boxes (N, 4), places in the grid, strides (N,)."""

    scores: str
    boxes: Array
    places: Array
    strides: Array

    @property
    def answers(self) -> Array:
        """(N,), True where objects are seen."""
        return np.asarray(self.strides == ANSWERING)

    @property
    def objectness(self) -> Array:
        """(N, 1): 1 where objects are seen, else at random."""
        noise = np.random.default_rng(SEED).uniform(0.0, 0.6, (len(self.boxes), 1))
        return np.where(self.answers[:, None], 1.0, noise).astype(np.float32)

    @property
    def corners(self) -> Array:
        """(N, 4)."""
        half = self.boxes[:, 2:] / 2
        return np.hstack([self.boxes[:, :2] - half, self.boxes[:, :2] + half]).astype(np.float32)


def save_model(
    path: Path,
    graph: Graph,
    outputs: Outputs,
    shape: list[int | str],
    declared: list[int | str] | None,
    metadata: dict[str, str],
) -> None:
    """Write a model of these outputs, (name, element type) each; `shape` is its input's, `declared` its outputs'."""
    made = helper.make_graph(
        graph.nodes,
        path.stem,
        [helper.make_tensor_value_info(graph.source, TensorProto.FLOAT, shape)],
        [helper.make_tensor_value_info(name, kind, declared) for name, kind in outputs],
        graph.constants,
    )
    model = helper.make_model(made, opset_imports=[helper.make_opsetid("", 13)], ir_version=8)
    helper.set_model_props(model, {key: value for key, value in metadata.items() if value})
    save(model, str(path))


def make_cells(graph: Graph, size_px: tuple[int, int], classes: int, bgr_bytes: bool) -> Cells:
    """Return the cells of an input of (width, height), with their scores computed from it."""
    width, height = size_px
    rng = np.random.default_rng(SEED)
    parts, boxes, places, strides = [], [], [], []
    order = ([2, 1] if bgr_bytes else [0, 1])[:classes]
    channels = graph.constant("channels", np.array(order + [0] * (classes - len(order))))
    for stride in STRIDES:
        pooled = graph.node("AveragePool", ["images"], f"pool{stride}", kernel_shape=[stride] * 2, strides=[stride] * 2)
        by_class = graph.node("Gather", [pooled, channels], f"colours{stride}", axis=1)
        shape = graph.constant("flat", np.array([1, classes, -1]))
        flat = graph.node("Reshape", [by_class, shape], f"flat{stride}")
        gain = np.zeros((1, classes, 1), np.float32)
        if stride == ANSWERING:
            gain[:, : len(order)] = 1.0 / 255.0 if bgr_bytes else 1.0
        parts.append(graph.node("Mul", [flat, graph.constant(f"gain{stride}", gain)], f"scaled{stride}"))
        y, x = np.mgrid[0 : height // stride, 0 : width // stride]
        places.append(np.column_stack([x.ravel(), y.ravel()]))
        centre = places[-1] + 0.5
        side = np.ones((x.size, 2))
        if stride != ANSWERING:
            centre += rng.uniform(-2.0, 2.0, centre.shape)
            side = np.exp(rng.uniform(-0.5, 2.5, side.shape))
        boxes.append(stride * np.hstack([centre, side]))
        strides.append(np.full(x.size, stride))
    joined = graph.node("Concat", parts, "by_class", axis=2)
    scores = graph.node("Transpose", [joined], "scores", perm=[0, 2, 1])
    return Cells(scores, np.concatenate(boxes).astype(np.float32), np.concatenate(places), np.concatenate(strides))
