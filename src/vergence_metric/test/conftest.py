"""Detectors built with the onnx library with known outputs: red and green cells of 16 px become boxes."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

try:
    import onnx
    from onnx import TensorProto, helper, numpy_helper
except ImportError:  # no rosdep key names it
    onnx = None

STRIDES = (8, 16, 32)
ANSWERING = 16
TOP = 10


class ModelBuilder:
    """Makes ONNX files of every layout. Class 0 is red, 1 green; a cell of 16 px of that colour scores its mean."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._count = 0

    def __call__(
        self,
        layout: str,
        size_px: tuple[int, int] = (128, 96),
        classes: int = 2,
        names: str | None = None,
        declared: list[int | str] | None = None,
        metadata: dict[str, str] | None = None,
        fixed: bool = True,
    ) -> Path:
        """Write a model for inputs of (width, height) and return its path."""
        self._nodes: list[onnx.NodeProto] = []
        self._constants: list[onnx.TensorProto] = []
        outputs = getattr(self, f"_{layout}")(*self._cells(size_px, classes, layout))
        width, height = size_px
        shape = [1, 3, height, width] if fixed else [1, 3, "height", "width"]
        graph = helper.make_graph(
            self._nodes,
            layout,
            [helper.make_tensor_value_info("images", TensorProto.FLOAT, shape)],
            [helper.make_tensor_value_info(name, kind, declared) for name, kind in outputs],
            self._constants,
        )
        model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)], ir_version=8)
        words = dict(metadata or {}) | ({"names": names} if names else {})
        helper.set_model_props(model, words)
        self._count += 1
        path = self._folder / f"{layout}_{self._count}.onnx"
        onnx.save(model, str(path))
        return path

    def _constant(self, name: str, value: np.ndarray) -> str:
        self._constants.append(numpy_helper.from_array(value, name))
        return name

    def _node(self, kind: str, inputs: list[str], output: str, **attributes: object) -> str:
        self._nodes.append(helper.make_node(kind, inputs, [output], **attributes))
        return output

    def _cells(self, size_px: tuple[int, int], classes: int, layout: str) -> tuple[str, np.ndarray, np.ndarray, int]:
        """Return the name of the scores (1, N, classes), boxes (N, 4) centre-size, strides (N,) and class count."""
        width, height = size_px
        parts, boxes, strides = [], [], []
        channels = self._constant("channels", np.arange(classes))
        source = self._node("Gather", ["images", channels], "colours", axis=1)
        for stride in STRIDES:
            pooled = self._node(
                "AveragePool", [source], f"pool{stride}", kernel_shape=[stride] * 2, strides=[stride] * 2
            )
            flat = self._node(
                "Reshape", [pooled, self._constant(f"flat{stride}", np.array([1, classes, -1]))], f"flat_{stride}"
            )
            gain = self._constant(f"gain{stride}", np.array(1.0 if stride == ANSWERING else 0.0, np.float32))
            parts.append(self._node("Mul", [flat, gain], f"scaled{stride}"))
            y, x = np.mgrid[0 : height // stride, 0 : width // stride]
            count = x.size
            boxes.append(
                np.column_stack(
                    [(x.ravel() + 0.5) * stride, (y.ravel() + 0.5) * stride, np.full((count, 2), float(stride))]
                )
            )
            strides.append(np.full(count, stride))
        joined = self._node("Concat", parts, "by_class", axis=2)
        scores = self._node("Transpose", [joined], "scores", perm=[0, 2, 1])
        return scores, np.concatenate(boxes).astype(np.float32), np.concatenate(strides), classes

    def _rows(self, scores: str, boxes: np.ndarray, repeat: int = 1) -> str:
        ones = np.ones((len(boxes), 1), np.float32)
        place = self._constant("place", np.hstack([boxes, ones])[None])
        rows = self._node("Concat", [place, scores], "rows", axis=2)
        if repeat == 1:
            return rows
        return self._node("Concat", [rows] * repeat, "repeated", axis=1)

    def _yolov6(self, scores: str, boxes: np.ndarray, strides: np.ndarray, classes: int) -> list[tuple[str, int]]:
        self._node("Identity", [self._rows(scores, boxes)], "outputs")
        return [("outputs", TensorProto.FLOAT)]

    def _yolov5(self, scores: str, boxes: np.ndarray, strides: np.ndarray, classes: int) -> list[tuple[str, int]]:
        self._node("Identity", [self._rows(scores, boxes, 3)], "output0")
        return [("output0", TensorProto.FLOAT)]

    def _yolov8(self, scores: str, boxes: np.ndarray, strides: np.ndarray, classes: int) -> list[tuple[str, int]]:
        place = self._constant("place", boxes.T[None].copy())
        columns = self._node("Transpose", [scores], "columns", perm=[0, 2, 1])
        self._node("Concat", [place, columns], "output0", axis=1)
        return [("output0", TensorProto.FLOAT)]

    def _yolox(self, scores: str, boxes: np.ndarray, strides: np.ndarray, classes: int) -> list[tuple[str, int]]:
        raw = np.hstack([np.full((len(boxes), 2), 0.5), np.log(boxes[:, 2:] / strides[:, None]) - 1e-3])
        self._node("Identity", [self._rows(scores, raw.astype(np.float32))], "output")
        return [("output", TensorProto.FLOAT)]

    def _best(self, scores: str, boxes: np.ndarray) -> tuple[str, str, str]:
        """Return names of the best rows' corners (1, K, 4), scores (1, K) and classes (1, K) as floats."""
        half = boxes[:, 2:] / 2
        corners = self._constant("corners", np.hstack([boxes[:, :2] - half, boxes[:, :2] + half]).astype(np.float32))
        best = self._node("ReduceMax", [scores], "best", axes=[2], keepdims=0)
        ids = self._node("ArgMax", [scores], "ids", axis=2, keepdims=0)
        count = self._constant("top", np.array([TOP]))
        self._nodes.append(helper.make_node("TopK", [best, count], ["top_scores", "top_rows"], axis=1))
        rows = self._node("Squeeze", ["top_rows", self._constant("first", np.array([0]))], "chosen")
        chosen = self._node("Gather", [corners, rows], "top_boxes", axis=0)
        batched = self._node("Unsqueeze", [chosen, "first"], "boxes_batched")
        top_ids = self._node("GatherElements", [ids, "top_rows"], "top_ids", axis=1)
        return batched, "top_scores", self._node("Cast", [top_ids], "ids_float", to=TensorProto.FLOAT)

    def _yolov10(self, scores: str, boxes: np.ndarray, strides: np.ndarray, classes: int) -> list[tuple[str, int]]:
        corners, best, ids = self._best(scores, boxes)
        last = self._constant("last", np.array([2]))
        columns = [corners, *(self._node("Unsqueeze", [name, last], f"{name}_column") for name in (best, ids))]
        self._node("Concat", columns, "output0", axis=2)
        return [("output0", TensorProto.FLOAT)]

    def _end_to_end(self, scores: str, boxes: np.ndarray, strides: np.ndarray, classes: int) -> list[tuple[str, int]]:
        corners, best, ids = self._best(scores, boxes)
        sure = self._node("Greater", [best, self._constant("half", np.array(0.5, np.float32))], "sure")
        whole = self._node("Cast", [sure], "sure_whole", to=TensorProto.INT32)
        self._node("ReduceSum", [whole, self._constant("along", np.array([1]))], "num_dets", keepdims=1)
        self._node("Identity", [corners], "det_boxes")
        self._node("Identity", [best], "det_scores")
        self._node("Cast", [ids], "det_classes", to=TensorProto.INT32)
        kinds = (TensorProto.INT32, TensorProto.FLOAT, TensorProto.FLOAT, TensorProto.INT32)
        return list(zip(("num_dets", "det_boxes", "det_scores", "det_classes"), kinds, strict=True))

    def _ort(self, scores: str, boxes: np.ndarray, strides: np.ndarray, classes: int) -> list[tuple[str, int]]:
        """Rows of batch, corners, class, score; their number is how many the NonMaxSuppression operator keeps."""
        half = boxes[:, 2:] / 2
        corners = np.hstack([boxes[:, :2] - half, boxes[:, :2] + half]).astype(np.float32)
        place = self._constant("corners", corners[None])
        columns = self._node("Transpose", [scores], "columns", perm=[0, 2, 1])
        limits = [
            self._constant("most", np.array([TOP])),
            self._constant("overlap", np.array([0.5], np.float32)),
            self._constant("least", np.array([0.5], np.float32)),
        ]
        kept = self._node("NonMaxSuppression", [place, columns, *limits], "kept")
        parts = []
        for number, name in enumerate(("batch", "class", "row")):
            index = self._constant(f"take_{name}", np.array([number]))
            parts.append(self._node("Gather", [kept, index], f"kept_{name}", axis=1))
        flat = self._constant("all", np.array([-1]))
        row = self._node("Reshape", [parts[2], flat], "row_flat")
        flat_boxes = self._constant("corners_flat", corners)
        chosen = self._node("Gather", [flat_boxes, row], "chosen", axis=0)
        best = self._node("GatherND", [columns, kept], "kept_scores")
        score = self._node("Unsqueeze", [best, self._constant("one", np.array([1]))], "kept_score")
        batch, kind = (
            self._node("Cast", [part], f"{part}_float", to=TensorProto.FLOAT) for part in (parts[0], parts[1])
        )
        self._node("Concat", [batch, chosen, kind, score], "outputs", axis=1)
        return [("outputs", TensorProto.FLOAT)]


@pytest.fixture
def onnx_model(tmp_path: Path) -> Callable[..., Path]:
    """A maker of ONNX detectors of every layout."""
    if onnx is None:
        pytest.skip("the onnx package is not installed: pip install onnx")
    return ModelBuilder(tmp_path)
