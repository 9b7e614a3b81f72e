"""The trained network as an ONNX file that describes itself."""

import json
from pathlib import Path

import numpy as np
import onnx
import onnxruntime
import torch

from training.dataset import INPUT_PX
from training.deployment import Deployed
from training.network import STRIDES, Detector
from vergence_metric.boxes.layouts.yolov6 import YoloV6


class ExportError(RuntimeError):
    """The outputs of the exported model differ from those of the trained one."""


def add_metadata(path: Path, entries: dict[str, str]) -> None:
    """Add entries to a model file's metadata, in place of those of the same name."""
    model = onnx.load(str(path))
    kept = {entry.key: entry.value for entry in model.metadata_props} | entries
    onnx.helper.set_model_props(model, kept)
    onnx.save(model, str(path))


def export(detector: Detector, path: Path, names: tuple[str, ...], about: dict[str, str]) -> float:
    """Write the model and return how far its boxes are from the trained network's at most [px].

    The file's metadata describe it: `names`, `stride`, `task`, `layout`, `imgsz` and `about`. Its input size is
    dynamic, sides are multiples of 16.
    """
    plain = Deployed(detector).eval()
    example = torch.rand(1, 3, INPUT_PX[1], INPUT_PX[0])
    with torch.no_grad():
        logits, boxes = detector.eval()(example)
        torch.onnx.export(
            plain,
            (example,),
            str(path),
            dynamo=False,
            opset_version=17,
            input_names=["images"],
            output_names=["outputs"],
            dynamic_axes={"images": {0: "batch", 2: "height", 3: "width"}, "outputs": {0: "batch", 1: "boxes"}},
        )
    facts = {
        "task": "detect",
        "layout": YoloV6.name,
        "stride": str(max(STRIDES)),
        "imgsz": json.dumps([INPUT_PX[1], INPUT_PX[0]]),
        "names": json.dumps(dict(enumerate(names))),
    }
    add_metadata(path, facts | about)
    onnx.checker.check_model(onnx.load(str(path)))
    session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    answer = session.run(None, {"images": example.numpy()})[0]
    corners = np.concatenate([answer[..., :2] - answer[..., 2:4] / 2, answer[..., :2] + answer[..., 2:4] / 2], axis=2)
    apart = float(np.abs(corners - boxes.numpy()).max())
    score_error = float(np.abs(answer[..., 4:5] * answer[..., 5:] - torch.sigmoid(logits).numpy()).max())
    if score_error > 1e-3:
        raise ExportError(f"{path}: scores must be within 0.001 of the trained network's: got {score_error:.3g}")
    if apart > 0.05:
        raise ExportError(f"{path}: boxes must be within 0.05 px of the trained network's: got {apart:.3g} px")
    return apart
