"""Every family's export is recognised and read, with one, two and eighty classes; what is none of them is refused."""

import cv2
import numpy as np
import pytest

from vergence_metric.boxes.class_names import COCO_NAMES
from vergence_metric.boxes.detector import Detector
from vergence_metric.boxes.errors import DetectorError, ModelLayoutError
from vergence_metric.boxes.parameters import DetectorParameters

onnx = pytest.importorskip("onnx", reason="the onnx package is not installed: pip install onnx")

from vergence_metric.testing.onnx_detectors import constant_detector  # noqa: E402
from vergence_metric.testing.onnx_grids import FACE_POINTS, FACE_SIDES  # noqa: E402

LAYOUTS = {
    "yolov5": "yolov5",
    "yolov6": "yolov6",
    "yolov7": "yolov5",
    "yolov8": "yolov8",
    "yolov9": "yolov8",
    "yolov10": "yolov10",
    "yolox": "yolox",
    "yolox_decoded": "yolox_decoded",
    "end_to_end": "yolov6_end_to_end",
    "ort": "yolov6_ort",
}
SEEN = [[31.5, 15.5, 47.5, 31.5], [79.5, 47.5, 95.5, 63.5]]
CELLS = 252  # of 128x96


def picture(width: int = 128, height: int = 96) -> np.ndarray:
    """A black picture with a red cell at column 2, row 1 and a green one at column 5, row 3 (of 16 px), BGR."""
    image = np.zeros((height, width, 3), np.uint8)
    image[16:32, 32:48, 2] = 255
    image[48:64, 80:96, 1] = 230
    return image


def load(path, **changes):
    return Detector(DetectorParameters(model=str(path)).replaced(**{"threshold": 0.5} | changes))


@pytest.mark.parametrize("classes", [1, 2, 80])
@pytest.mark.parametrize("kind", LAYOUTS)
def test_every_family_is_recognised_and_read(kind, classes, onnx_model):
    detector = load(onnx_model(kind, classes=classes))
    assert detector.layout.name == LAYOUTS[kind]
    found = detector.detect(picture())
    count = min(classes, 2)
    np.testing.assert_allclose(found.xyxy_px, SEEN[:count], atol=1e-3)
    np.testing.assert_allclose(found.scores, [1.0, 230 / 255][:count], atol=1e-5)
    assert found.class_ids.tolist() == [0, 1][:count]
    if detector.layout.classes == 80:
        assert found.class_names == ("person", "bicycle")


@pytest.mark.parametrize("size_px", [(416, 416), (320, 224), (64, 64)])
@pytest.mark.parametrize("kind", ["yolov6", "yolox", "yolox_decoded", "yolov5", "yolov8"])
def test_every_size_of_input(kind, size_px, onnx_model):
    detector = load(onnx_model(kind, size_px))
    assert detector.layout.name == LAYOUTS[kind]
    assert detector.layout.strides == (8, 16, 32)


@pytest.mark.parametrize("classes", [1, 2, 80])
def test_rows_without_objectness_ask_for_the_layout_or_the_names(classes, onnx_model, tmp_path):
    path = onnx_model("yolov8_rows", classes=classes)
    if classes == 1:
        # Five columns: an objectness without a class is nothing that a YOLO has.
        assert load(path).layout.name == "yolov8_rows"
        return
    with pytest.raises(
        ModelLayoutError, match=r"could be yolov6 or yolox_decoded or yolov8_rows: say which by"
    ) as asked:
        load(path)
    assert "'detector.layout'" in str(asked.value)
    assert "'detector.labels'" in str(asked.value)
    names = tmp_path / "names.txt"
    names.write_text("\n".join(COCO_NAMES[:classes]) + "\n")
    for options in ({"layout": "yolov8_rows"}, {"labels": str(names)}):
        detector = load(path, **options)
        assert detector.layout.name == "yolov8_rows"
        assert detector.detect(picture()).class_ids.tolist() == [0, 1]
    names.write_text("one\n")
    with pytest.raises(ModelLayoutError, match="could be yolov6 or yolox_decoded or yolov8_rows"):
        load(path, labels=str(names))
    named = load(onnx_model("yolov8_rows", classes=classes, names=str(list(COCO_NAMES[:classes]))))
    assert named.layout.classes == classes


def test_the_name_of_the_output_distinguishes_decoded_yolox_from_the_first_yolov6(onnx_model):
    assert load(onnx_model("yolox_decoded", renamed="outputs")).layout.name == "yolov6"
    with pytest.raises(ModelLayoutError, match="could be yolov6 or yolox_decoded or yolov8_rows"):
        load(onnx_model("yolox_decoded", renamed="boxes_and_scores"))


@pytest.mark.parametrize("classes", [1, 2, 80])
@pytest.mark.parametrize("kind", ["rt_detr", "logits", "nas_flat"])
def test_what_only_looks_like_a_layout_is_refused(kind, classes, onnx_model):
    with pytest.raises(ModelLayoutError, match=r"model's outputs .* must have|of the detector layouts") as refused:
        load(onnx_model(kind, classes=classes))
    assert "\n" not in str(refused.value)


def test_values_that_contradict_are_named_and_the_parameter_decides(onnx_model):
    path = onnx_model("logits")
    with pytest.raises(ModelLayoutError, match=r"to be yolov6, its scores must be 0 to 1: got -4 .*'detector\.layout'"):
        load(path)
    assert load(path, layout="yolov6").layout.name == "yolov6"


def test_rows_with_score_and_class_exchanged_are_an_error_when_they_come(onnx_model, tmp_path):
    """A picture of test patterns shows nothing, so that only an image gives rows."""
    detector = load(onnx_model("ort"))
    rows = np.array([[0, 8, 8, 40, 40, 0.7, 3.0]])
    with pytest.raises(DetectorError, match="column 5 must be numbers of classes"):
        detector.layout.candidates([rows], (128, 96), 0.5)


def test_yunet_gives_faces_with_landmarks(onnx_model):
    detector = load(onnx_model("yunet"))
    assert detector.layout.name == "yunet"
    assert detector.class_names == ("face",)
    assert detector.preprocessing.border == 0
    (face,) = detector.detect(picture())
    assert face.class_name == "face"
    centre, half = np.array([39.5, 23.5]), 8.0 * np.array(FACE_SIDES)
    np.testing.assert_allclose(face.xyxy_px, [*(centre - half), *(centre + half)], atol=1e-4)
    np.testing.assert_allclose(face.landmarks_px, 16.0 * np.array(FACE_POINTS) + [31.5, 15.5], atol=1e-4)
    np.testing.assert_allclose(face.point_px, [39.5, 18.7], atol=1e-4)


@pytest.mark.skipif(not hasattr(cv2, "FaceDetectorYN"), reason="this OpenCV has no FaceDetectorYN")
@pytest.mark.parametrize("size_px", [(128, 96), (120, 90)])
def test_yunet_is_read_as_opencv_reads_it(size_px, onnx_model):
    """OpenCV pads to whole strides, and counts from the outer corner of the first pixel."""
    path = onnx_model("yunet")
    onnx.save(onnx.shape_inference.infer_shapes(onnx.load(str(path))), str(path))
    image = picture(*size_px)
    reference = cv2.FaceDetectorYN.create(str(path), "", size_px, 0.6, 0.3, 100)
    _, faces = reference.detect(image)
    assert faces is not None
    (expected,) = faces
    detector = load(path, resize="corner", threshold=0.6)
    if size_px == (120, 90):
        # The input is fixed: what OpenCV pads is here part of the image.
        image = cv2.copyMakeBorder(image, 0, 6, 0, 8, cv2.BORDER_CONSTANT, value=(0, 0, 0))
    (face,) = detector.detect(image)
    x, y, width, height = expected[:4]
    np.testing.assert_allclose(face.xyxy_px, np.array([x, y, x + width, y + height]) - 0.5, atol=1e-3)
    np.testing.assert_allclose(face.landmarks_px, expected[4:14].reshape(5, 2) - 0.5, atol=1e-3)
    assert face.score == pytest.approx(float(expected[14]), abs=1e-5)


def test_yunet_with_an_output_too_few_or_of_another_grid_is_refused(tmp_path):
    names = [f"{part}_{stride}" for part in ("cls", "obj", "bbox", "kps") for stride in (8, 16, 32)]
    columns = {"cls": 1, "obj": 1, "bbox": 4, "kps": 10}
    outputs = [
        np.zeros((1, 128 * 96 // int(name.split("_")[1]) ** 2, columns[name.split("_")[0]]), np.float32)
        for name in names
    ]
    assert load(constant_detector(tmp_path / "whole.onnx", *outputs, names=tuple(names))).layout.name == "yunet"
    for broken in (outputs[:-1], [*outputs[:-1], outputs[-1][:, 1:]]):
        path = constant_detector(tmp_path / "broken.onnx", *broken, names=tuple(names[: len(broken)]))
        with pytest.raises(ModelLayoutError, match="must"):
            load(path)


def yolov8_output(classes: int = 2) -> np.ndarray:
    """Centres of the 252 cells of 128x96, and small scores."""
    places = np.concatenate([np.argwhere(np.ones((96 // s, 128 // s)))[:, ::-1] * s + s / 2 for s in (8, 16, 32)])
    output = np.full((1, 4 + classes, CELLS), 12.0, np.float32)
    output[0, :2] = places.T
    output[0, 4:] = np.linspace(0.0, 0.3, CELLS)
    return output


@pytest.mark.parametrize("layout", ["auto", "yolox", "yolov8"])
@pytest.mark.parametrize("shape", [(1, 252, 4), (1, 252), (1, 10), (1, 32, 24, 32), (1,)])
def test_an_output_that_no_layout_explains_refuses_the_model(tmp_path, shape, layout):
    model = constant_detector(tmp_path / "model.onnx", yolov8_output(), np.zeros(shape, np.float32))
    with pytest.raises(ModelLayoutError, match=r"must be explained: output1 \[1") as refused:
        load(model, layout=layout)
    assert "\n" not in str(refused.value)


def test_boxes_and_scores_apart_are_no_layout(tmp_path):
    boxes, scores = np.zeros((1, CELLS, 4), np.float32), np.zeros((1, CELLS, 80), np.float32)
    with pytest.raises(ModelLayoutError, match=r"must be explained: output0 \[1, 252, 4\]"):
        load(constant_detector(tmp_path / "model.onnx", boxes, scores))


def test_the_maps_before_decoding_are_explained_and_alone_are_refused(tmp_path):
    maps = [np.zeros((1, 66, 96 // s, 128 // s), np.float32) for s in (8, 16, 32)]
    assert load(constant_detector(tmp_path / "both.onnx", yolov8_output(), *maps)).layout.name == "yolov8"
    raw = [np.zeros((1, 3, 96 // s, 128 // s, 85), np.float32) for s in (8, 16, 32)]
    with pytest.raises(ModelLayoutError, match=r"must have one of the detector layouts .*maps before decoding.*--grid"):
        load(constant_detector(tmp_path / "raw.onnx", *raw))


def test_a_pose_without_its_metadata_is_refused(tmp_path):
    """56 columns for rows: box, score and 17 points in pixels."""
    output = np.concatenate([yolov8_output(1), np.full((1, 51, CELLS), 40.0, np.float32)], axis=1)
    with pytest.raises(ModelLayoutError, match="its scores must be 0 to 1"):
        load(constant_detector(tmp_path / "pose.onnx", output))


def test_nan_is_an_error_at_the_start_and_later(tmp_path, onnx_model):
    broken = yolov8_output()
    broken[0, 4, 7] = np.nan
    for layout in ("auto", "yolov8"):
        with pytest.raises(ModelLayoutError, match=r"must be numbers: 0% of \[1, 6, 252\] are NaN"):
            load(constant_detector(tmp_path / "model.onnx", broken), layout=layout)
    detector = load(onnx_model("yolov8"))
    with pytest.raises(DetectorError, match="output 0 of the model must be numbers"):
        detector.layout.candidates([np.full((1, 6, 252), np.nan, np.float32)], (128, 96), 0.5)


def test_rows_whose_values_fit_no_layout_ask_for_one(tmp_path):
    rows = np.zeros((1, CELLS, 6), np.float32)
    rows[..., :4] = [64, 48, 72, 56]
    rows[..., 4], rows[..., 5] = np.linspace(0.9, 0.1, CELLS), 0.5
    path = constant_detector(tmp_path / "model.onnx", rows)
    with pytest.raises(ModelLayoutError, match=r"must have the values of a layout.*to be yolov10, .*detector\.layout"):
        load(path)
    assert load(path, layout="yolov10").layout.name == "yolov10"
    assert load(path, layout="yolov6").layout.name == "yolov6"


def test_a_model_that_is_no_detector(tmp_path):
    with pytest.raises(ModelLayoutError, match=r"must have one of the detector layouts .*: got output0 \[1, 1000\]"):
        load(constant_detector(tmp_path / "model.onnx", np.zeros((1, 1000), np.float32)))


def test_a_model_for_another_task(tmp_path):
    model = constant_detector(tmp_path / "model.onnx", np.zeros((1, 37, CELLS), np.float32), task="segment")
    with pytest.raises(ModelLayoutError, match="task must be 'detect': got 'segment'"):
        load(model)


def test_a_wanted_layout_that_does_not_fit(onnx_model):
    with pytest.raises(ModelLayoutError, match="must have the layout 'yolov8'"):
        load(onnx_model("yolov6"), layout="yolov8")
