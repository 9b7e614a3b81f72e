"""Every layout is found and read; what cannot be used says so in one line."""

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
TensorProto, helper = onnx.TensorProto, onnx.helper

LAYOUTS = {
    "yolov6": "yolov6",
    "yolov5": "yolov5",
    "yolov8": "yolov8",
    "yolox": "yolox",
    "yolov10": "yolov10",
    "end_to_end": "yolov6_end_to_end",
    "ort": "yolov6_ort",
}


def picture(width: int = 128, height: int = 96) -> np.ndarray:
    """A black picture with a red cell at column 2, row 1 and a green one at column 5, row 3 (of 16 px), BGR."""
    image = np.zeros((height, width, 3), np.uint8)
    image[16:32, 32:48, 2] = 255
    image[48:64, 80:96, 1] = 230
    return image


def load(path: Path, **changes: object) -> Detector:
    return Detector(DetectorParameters(model=str(path)).replaced(**{"threshold": 0.5} | changes))


@pytest.mark.parametrize("kind", LAYOUTS)
def test_every_layout_is_found_and_read(kind, onnx_model):
    # The input of YOLOX is BGR bytes, with which this model's scores would be 255 times too high.
    override = {"color": "rgb", "scale": "unit", "resize": "letterbox"} if kind == "yolox" else {}
    detector = load(onnx_model(kind), **override)
    assert detector.layout.name == LAYOUTS[kind]
    found = detector.detect(picture())
    np.testing.assert_allclose(found.xyxy_px, [[31.5, 15.5, 47.5, 31.5], [79.5, 47.5, 95.5, 63.5]], atol=0.02)
    np.testing.assert_allclose(found.scores, [1.0, 230 / 255], atol=1e-5)
    assert found.class_ids.tolist() == [0, 1]


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


def test_one_class_yolov6_is_distinguished_from_end_to_end(onnx_model):
    # Both are (1, N, 6); objectness is 1 throughout.
    detector = load(onnx_model("yolov6", classes=1))
    assert detector.layout.name == "yolov6"
    assert len(detector.detect(picture())) == 1


def test_a_shape_that_could_be_two_layouts_asks_for_one(tmp_path):
    """Rows whose values agree with no layout: the shape alone does not decide."""
    rows = np.zeros((1, 252, 6), np.float32)  # 252 = cells of 128x96
    rows[..., :4] = [64, 48, 72, 56]
    rows[..., 4], rows[..., 5] = np.linspace(0.9, 0.1, 252), 0.0
    path = constant_model(tmp_path, rows)
    with pytest.raises(ModelLayoutError, match=r"could be yolov6 or yolox or yolov10: say which by .*detector\.layout"):
        load(path)
    assert load(path, layout="yolov10").layout.name == "yolov10"
    assert load(path, layout="yolov6").layout.name == "yolov6"


def constant_model(folder: Path, *outputs: np.ndarray, task: str = "") -> Path:
    """A model that always gives the same outputs."""
    mean = helper.make_node("ReduceMean", ["images"], ["mean"], keepdims=0)
    nothing = helper.make_node("Mul", ["mean", "zero"], ["nothing"])
    names = [f"output{i}" for i in range(len(outputs))]
    graph = helper.make_graph(
        [mean, nothing, *(helper.make_node("Add", [f"constant_{name}", "nothing"], [name]) for name in names)],
        "constant",
        [helper.make_tensor_value_info("images", TensorProto.FLOAT, [1, 3, 96, 128])],
        [helper.make_tensor_value_info(name, TensorProto.FLOAT, None) for name in names],
        [
            onnx.numpy_helper.from_array(np.array(0.0, np.float32), "zero"),
            *(
                onnx.numpy_helper.from_array(output, f"constant_{name}")
                for name, output in zip(names, outputs, strict=True)
            ),
        ],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)], ir_version=8)
    if task:
        helper.set_model_props(model, {"task": task})
    path = folder / "constant.onnx"
    onnx.save(model, str(path))
    return path


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
    path = constant_model(tmp_path, np.array([[[8, 16, 40, 64, 0.9], [8, 16, 41, 64, 0.7]]], np.float32))
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


def test_a_model_that_is_no_detector(tmp_path):
    with pytest.raises(ModelLayoutError, match=r"must have one of the detector layouts .*: got output0 \[1, 1000\]"):
        load(constant_model(tmp_path, np.zeros((1, 1000), np.float32)))


def test_a_model_for_another_task(tmp_path):
    with pytest.raises(ModelLayoutError, match="task must be 'detect': got 'segment'"):
        load(constant_model(tmp_path, np.zeros((1, 37, 252), np.float32), task="segment"))


def test_a_wanted_layout_that_does_not_fit(onnx_model):
    with pytest.raises(ModelLayoutError, match="must have the layout 'yolov8'"):
        load(onnx_model("yolov6"), layout="yolov8")


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


def yolov8_output(classes: int = 2) -> np.ndarray:
    """Boxes that grow, and small scores, for the 252 cells of 128x96."""
    output = np.zeros((1, 4 + classes, 252), np.float32)
    output[0, :4] = np.linspace(10, 90, 252)
    output[0, 4:] = np.linspace(0.0, 0.3, 252)
    return output


@pytest.mark.parametrize("layout", ["auto", "yolox", "yolov8"])
@pytest.mark.parametrize("shape", [(1, 252, 4), (1, 252), (1, 10), (1, 32, 24, 32), (1,)])
def test_an_output_that_no_layout_explains_refuses_the_model(tmp_path, shape, layout):
    model = constant_model(tmp_path, yolov8_output(), np.zeros(shape, np.float32))
    with pytest.raises(ModelLayoutError, match=r"must be explained: output1 \[1") as refused:
        load(model, layout=layout)
    assert "\n" not in str(refused.value)


def test_boxes_and_scores_apart_are_no_yolox(tmp_path):
    boxes, scores = np.zeros((1, 252, 4), np.float32), np.zeros((1, 252, 80), np.float32)
    with pytest.raises(ModelLayoutError, match=r"must be explained: output0 \[1, 252, 4\]"):
        load(constant_model(tmp_path, boxes, scores))


def test_the_maps_before_decoding_are_explained(tmp_path):
    maps = [np.zeros((1, 66, 96 // s, 128 // s), np.float32) for s in (8, 16, 32)]
    assert load(constant_model(tmp_path, yolov8_output(), *maps)).layout.name == "yolov8"


def test_nan_is_an_error_at_the_start_and_later(tmp_path, onnx_model):
    broken = yolov8_output()
    broken[0, 4, 7] = np.nan
    with pytest.raises(ModelLayoutError, match=r"must be numbers: 0% of \[1, 6, 252\] are NaN"):
        load(constant_model(tmp_path, broken))
    detector = load(onnx_model("yolov8"))
    with pytest.raises(DetectorError, match="output 0 of the model must be numbers"):
        detector.layout.candidates([np.full((1, 6, 252), np.nan, np.float32)], (128, 96), 0.5)
