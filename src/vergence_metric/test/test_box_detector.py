"""What a detector does with images, classes and parameters; what cannot be used says so in one line."""

import sys
from pathlib import Path

import numpy as np
import pytest

from vergence_metric.boxes.detector import Detector
from vergence_metric.boxes.errors import (
    DetectorError,
    DetectorImageError,
    ModelClassError,
    ModelFileError,
    ModelLayoutError,
)
from vergence_metric.boxes.layouts import Candidates, Layout, register_layout, registry
from vergence_metric.boxes.parameters import DetectorParameters
from vergence_rig.parameters import ParameterError

onnx = pytest.importorskip("onnx", reason="the onnx package is not installed: pip install onnx")

from vergence_metric.testing.onnx_detectors import constant_detector  # noqa: E402

TensorProto, helper = onnx.TensorProto, onnx.helper


def picture(width: int = 128, height: int = 96) -> np.ndarray:
    """A black picture with a red cell at column 2, row 1 and a green one at column 5, row 3 (of 16 px), BGR."""
    image = np.zeros((height, width, 3), np.uint8)
    image[16:32, 32:48, 2] = 255
    image[48:64, 80:96, 1] = 230
    return image


def load(path: Path, **changes: object) -> Detector:
    return Detector(DetectorParameters(model=str(path)).replaced(**{"threshold": 0.5} | changes))


@pytest.mark.parametrize("kind", ["yolov6", "yolov8", "end_to_end", "ort"])
def test_nothing_in_view_gives_no_boxes(kind, onnx_model):
    found = load(onnx_model(kind)).detect(np.zeros((96, 128, 3), np.uint8))
    assert len(found) == 0
    assert found.xyxy_px.shape == (0, 4)


def test_declared_shapes_are_not_used(onnx_model):
    path = onnx_model("yolov6", declared=[1, 8400, 85])
    assert load(path).layout.name == "yolov6"
    assert len(load(path).detect(picture())) == 2


def test_boxes_come_back_to_the_images_own_pixels(onnx_model):
    detector = load(onnx_model("yolov6"))
    # 256x160 into 128x96: halved, 8 rows of border above and below. The red cell is rows 8..24 of the picture's half.
    image = np.zeros((160, 256, 3), np.uint8)
    image[16:48, 64:96, 2] = 255
    found = detector.detect(image)
    np.testing.assert_allclose(found.xyxy_px, [[63.5, 15.5, 95.5, 47.5]], atol=1e-9)
    assert found.image_size_px == (256, 160)


def test_channels_and_range_can_be_overridden(onnx_model):
    path = onnx_model("yolov6")
    swapped = load(path, color="bgr").detect(picture())
    assert swapped.class_ids.tolist() == [1]  # its class 0 now sees blue
    byte = load(path, scale="byte", threshold=0.0, max_objects=1).detect(picture())
    assert byte.scores[0] == pytest.approx(255.0)


class CornerRows(Layout):
    """A layout of one's own: rows of five columns, corners and score of one class."""

    name = "corner_rows"
    description = "rows of corners and score"

    @classmethod
    def matches(cls, warm_up):
        fits = [i for i, output in enumerate(warm_up.outputs) if output.ndim == 3 and output.shape[2] == 5]
        return cls((fits[0],), 1) if fits else None

    def decode(self, outputs, input_px, threshold):
        rows = np.asarray(outputs[0][0], np.float64)
        return Candidates(rows[:, :4], rows[:, 4], np.zeros(len(rows), np.int64))


def test_a_layout_of_ones_own_can_be_registered(tmp_path, monkeypatch):
    path = constant_detector(
        tmp_path / "rows.onnx", np.array([[[8, 16, 40, 64, 0.9], [8, 16, 41, 64, 0.7]]], np.float32)
    )
    with pytest.raises(ModelLayoutError, match="must have one of the detector layouts"):
        load(path)
    monkeypatch.setattr(registry, "_LAYOUTS", dict(registry._LAYOUTS))
    register_layout(CornerRows)
    for wanted in ("auto", "corner_rows"):
        detector = load(path, layout=wanted)
        assert detector.layout.name == "corner_rows"
        np.testing.assert_allclose(detector.detect(picture()).xyxy_px, [[7.5, 15.5, 39.5, 63.5]], atol=1e-6)
    with pytest.raises(ValueError, match="must be new: got 'corner_rows'"):
        register_layout(CornerRows)


def test_a_layout_that_is_not_registered_is_refused():
    with pytest.raises(ParameterError, match="corner_rows"):
        DetectorParameters(layout="corner_rows")


def test_a_missing_file(tmp_path):
    with pytest.raises(ModelFileError, match=r"gone\.onnx: no such file"):
        load(tmp_path / "gone.onnx")


@pytest.mark.parametrize("keep", [0.5, 0.0])
def test_a_truncated_file(keep, onnx_model, tmp_path):
    whole = onnx_model("yolov6").read_bytes()
    broken = tmp_path / "broken.onnx"
    broken.write_bytes(whole[: int(len(whole) * keep)])
    with pytest.raises(DetectorError, match=r"broken\.onnx") as caught:
        load(broken)
    assert "\n" not in str(caught.value)


def test_a_tensorrt_export(tmp_path):
    node = helper.make_node("EfficientNMS_TRT", ["images"], ["num_dets"], domain="TRT")
    graph = helper.make_graph(
        [node],
        "trt",
        [helper.make_tensor_value_info("images", TensorProto.FLOAT, [1, 3, 96, 128])],
        [helper.make_tensor_value_info("num_dets", TensorProto.INT32, [1, 1])],
    )
    opsets = [helper.make_opsetid("", 13), helper.make_opsetid("TRT", 1)]
    path = tmp_path / "trt.onnx"
    onnx.save(helper.make_model(graph, opset_imports=opsets, ir_version=8), str(path))
    with pytest.raises(ModelFileError, match="exported for TensorRT"):
        load(path)


def test_classes_by_name_and_number(onnx_model):
    path = onnx_model("yolov6", names="{0: 'tomato', 1: 'leaf'}")  # as ultralytics writes them
    assert load(path, classes=("leaf",)).detect(picture()).class_names == ("leaf",)
    assert load(path, classes=("0",)).detect(picture()).class_names == ("tomato",)
    with pytest.raises(ModelClassError, match=r"class must be one of the model's \(tomato, leaf\): got 'cube'"):
        load(path, classes=("cube",))
    with pytest.raises(ModelClassError, match="got '2'"):
        load(path, classes=("2",))


def test_thresholds_can_change_while_running(onnx_model):
    detector = load(onnx_model("yolov6"))
    detector.set_parameters(DetectorParameters(threshold=0.95))
    assert len(detector.detect(picture())) == 1


def test_a_dynamic_input_gets_whole_strides(onnx_model):
    path = onnx_model("yolov6", fixed=False, metadata={"stride": "32"})
    detector = load(path, input_width_px=120, input_height_px=70)
    assert detector.input_px == (128, 96)


def test_a_device_that_is_not_there(onnx_model):
    with pytest.raises(DetectorError, match=r"this onnxruntime has \(.*cpu\): got 'coreml'"):
        load(onnx_model("yolov6"), device="coreml")


@pytest.mark.parametrize("image", [np.zeros((4, 4, 4), np.uint8), np.zeros((4, 4, 3)), np.zeros((0, 4, 3), np.uint8)])
def test_images_that_are_none(image, onnx_model):
    with pytest.raises(DetectorImageError, match="image must be uint8"):
        load(onnx_model("yolov6")).detect(image)


def test_grey_images_are_taken(onnx_model):
    assert len(load(onnx_model("yolov6")).detect(np.full((96, 128), 255, np.uint8))) > 0


def test_without_onnxruntime_it_says_so(onnx_model, monkeypatch):
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    with pytest.raises(DetectorError, match="onnxruntime is not installed"):
        load(onnx_model("yolov6"))


def test_the_model_names_its_own_threshold(onnx_model):
    strict = onnx_model("yolov6", metadata={"threshold": "0.95"})
    assert load(strict, threshold=0.0).threshold == 0.95
    assert len(load(strict, threshold=0.0).detect(picture())) == 1
    assert len(load(strict, threshold=0.5).detect(picture())) == 2
    assert load(onnx_model("yolov6", metadata={"threshold": "high"}), threshold=0.0).threshold == 0.35
