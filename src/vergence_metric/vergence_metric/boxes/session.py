"""An ONNX model in onnxruntime: loaded with clear errors, its input checked, its metadata read."""

import ast
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vergence_metric.boxes.class_names import names_of
from vergence_metric.boxes.errors import DetectorError, ModelFileError, ModelLayoutError
from vergence_rig.install_hint import install_hint
from vergence_rig.regular_file import FileError, check_regular_file, expanded

SHIPPED_MODEL = Path(__file__).resolve().parent.parent / "models" / "rubik_cube.onnx"

_PROVIDERS = {
    "cpu": "CPUExecutionProvider",
    "cuda": "CUDAExecutionProvider",
    "tensorrt": "TensorrtExecutionProvider",
    "openvino": "OpenVINOExecutionProvider",
    "coreml": "CoreMLExecutionProvider",
    "directml": "DmlExecutionProvider",
}
DEVICES = tuple(_PROVIDERS)
"""What the parameter `detector.device` may be."""

_TYPES: dict[str, Any] = {
    "tensor(float)": np.float32,
    "tensor(float16)": np.float16,
    "tensor(double)": np.float64,
    "tensor(uint8)": np.uint8,
}


@dataclass(frozen=True)
class InputSpec:
    """The model's input: its name, element type, and (height, width), None where any size is taken."""

    name: str
    dtype: Any
    height_px: int | None
    width_px: int | None


class ModelSession:
    """A loaded model; `run` feeds one tensor and returns all outputs."""

    def __init__(self, path: str | Path, device: str, threads: int) -> None:
        """Load a model.

        Args:
            path: of the ONNX file; "" for the shipped one.
            device: see DetectorParameters.
            threads: that an operator may use; 0 leaves it to onnxruntime.

        Raises:
            ModelFileError: the file is missing, truncated, not ONNX, or needs operators that onnxruntime lacks.
            ModelLayoutError: its input is not a picture.

        """
        self.path = expanded(path) if str(path) else SHIPPED_MODEL
        if not self.path.exists():
            raise ModelFileError(f"model {self.path}: no such file")
        try:
            check_regular_file(self.path)
        except FileError as error:
            raise ModelFileError(f"model {self.path} {error}") from error
        try:
            import onnxruntime
        except ImportError as error:
            raise DetectorError(f"onnxruntime is not installed: {install_hint('onnxruntime')}") from error
        provider = _PROVIDERS[device]
        available = onnxruntime.get_available_providers()
        if provider not in available:
            here = ", ".join(name for name, p in _PROVIDERS.items() if p in available)
            raise DetectorError(f"device must be one that this onnxruntime has ({here}): got {device!r}")
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads, options.inter_op_num_threads = threads, 1
        # Threads that spin while they wait would occupy the cores of other nodes.
        options.add_session_config_entry("session.intra_op.allow_spinning", "0")
        options.log_severity_level = 3
        providers = list(dict.fromkeys([provider, _PROVIDERS["cpu"]]))
        try:
            self._session = onnxruntime.InferenceSession(str(self.path), options, providers=providers)
        except Exception as error:
            raise ModelFileError(f"model {self.path}: {_reason(error)}") from error
        self.metadata = dict(self._session.get_modelmeta().custom_metadata_map)
        self.output_names = [output.name for output in self._session.get_outputs()]
        self.input = self._input()

    def run(self, tensor: NDArray[Any]) -> list[NDArray[Any]]:
        """Return all outputs; raises DetectorError where the model fails."""
        try:
            outputs = self._session.run(None, {self.input.name: tensor})
        except Exception as error:
            raise DetectorError(f"model {self.path}: cannot run: {_line(error)}") from error
        return [np.asarray(output) for output in outputs]

    def class_names(self) -> tuple[str, ...]:
        """Return the classes' names in the metadata; empty if there are none."""
        text = self.metadata.get("names", "")
        for parse in (json.loads, ast.literal_eval):
            try:
                return names_of(parse(text))
            except (ValueError, SyntaxError):
                continue
        return ()

    def stride_px(self) -> int:
        """Return what the input's sides must be multiples of."""
        text = self.metadata.get("stride", "32")
        return int(float(text)) if text.replace(".", "", 1).isdigit() and float(text) >= 1 else 32

    def metadata_threshold(self) -> float | None:
        """Return the least score of an object in the metadata, None if there is none."""
        try:
            value = float(self.metadata.get("threshold", ""))
        except ValueError:
            return None
        return value if 0.0 < value < 1.0 else None

    def metadata_input_px(self) -> tuple[int, int] | None:
        """Return the input's (width, height) [px] in the metadata, None if there is none."""
        try:
            height, width = json.loads(self.metadata.get("imgsz", ""))
        except (ValueError, TypeError):
            return None
        return (width, height) if isinstance(height, int) and isinstance(width, int) else None

    def _input(self) -> InputSpec:
        inputs = self._session.get_inputs()
        if len(inputs) != 1:
            names = ", ".join(spec.name for spec in inputs)
            raise ModelLayoutError(
                f"model {self.path}: its input must be one picture: got {len(inputs)} inputs ({names})"
            )
        spec, shape = inputs[0], list(inputs[0].shape)
        batch, channels = (shape[0], shape[1]) if len(shape) == 4 else (None, None)
        if len(shape) != 4 or (isinstance(channels, int) and channels != 3) or spec.type not in _TYPES:
            raise ModelLayoutError(
                f"model {self.path}: its input '{spec.name}' must be (1, 3, height, width) of float, half, double or "
                f"uint8: got {spec.type} {shape}"
            )
        if isinstance(batch, int) and batch != 1:
            raise ModelLayoutError(f"model {self.path}: its batch size must be 1 or dynamic: got {batch}")
        sides = [side if isinstance(side, int) and side > 0 else None for side in shape[2:]]
        return InputSpec(spec.name, _TYPES[spec.type], sides[0], sides[1])


def _reason(error: Exception) -> str:
    text = _line(error)
    for name in ("EfficientNMS", "BatchedNMS", "TRT_NMS", "TRT:", "TRTBatchedNMS"):
        if name in text:
            return (
                "it was exported for TensorRT, whose plugins onnxruntime does not have: export it without end-to-end "
                "suppression, or for onnxruntime"
            )
    if any(word in text for word in ("InvalidProtobuf", "INVALID_PROTOBUF", "Protobuf parsing failed", "ModelProto")):
        return "it is not a complete ONNX model (truncated, or another kind of file)"
    if "is not a registered function/op" in text or "NOT_IMPLEMENTED" in text:
        return f"it needs an operator that this onnxruntime does not have: {text}"
    return f"onnxruntime cannot load it: {text}"


def _line(error: Exception) -> str:
    return " ".join(str(error).split())[:300]
