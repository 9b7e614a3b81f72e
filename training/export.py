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


class ExportError(RuntimeError):
    """The exported model does not answer as the trained one does."""


def add_words(path: Path, words: dict[str, str]) -> None:
    """Put words into a model file's metadata, in place of those of the same name."""
    model = onnx.load(str(path))
    kept = {entry.key: entry.value for entry in model.metadata_props} | words
    onnx.helper.set_model_props(model, kept)
    onnx.save(model, str(path))


def export(detector: Detector, path: Path, names: tuple[str, ...], about: dict[str, str]) -> float:
    """Write the model and return how far its boxes are from the trained network's at most [px].

    The file's metadata say what it is: `names`, `stride`, `task`, and `about`. Its input size is dynamic, sides are
    multiples of 16.
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
        "layout": "yolov6",
        "stride": str(max(STRIDES)),
        "imgsz": json.dumps([INPUT_PX[1], INPUT_PX[0]]),
        "names": json.dumps(dict(enumerate(names))),
    }
    add_words(path, facts | about)
    onnx.checker.check_model(onnx.load(str(path)))
    session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    answer = session.run(None, {"images": example.numpy()})[0]
    corners = np.concatenate([answer[..., :2] - answer[..., 2:4] / 2, answer[..., :2] + answer[..., 2:4] / 2], axis=2)
    apart = float(np.abs(corners - boxes.numpy()).max())
    doubt = float(np.abs(answer[..., 4:5] * answer[..., 5:] - torch.sigmoid(logits).numpy()).max())
    if doubt > 1e-3:
        raise ExportError(f"{path}: the exported model's scores are {doubt:.3g} off the trained one's")
    if apart > 0.05:
        raise ExportError(f"{path}: the exported model is {apart:.3g} off the trained one: allowed is 0.05")
    return apart
