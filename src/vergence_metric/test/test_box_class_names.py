"""Names of classes: of a labels file, of the metadata, of the layout, or the COCO list."""

import pytest

from vergence_metric.boxes.class_names import COCO_NAMES, class_names, read_labels
from vergence_metric.boxes.detector import Detector
from vergence_metric.boxes.errors import ModelClassError
from vergence_metric.boxes.parameters import DetectorParameters


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("names.txt", "tomato\nleaf\n\n"),
        ("names.yaml", "names:\n  1: leaf\n  0: tomato\nnc: 2\n"),
        ("data.yml", "names: [tomato, leaf]\n"),
        ("names.json", '["tomato", "leaf"]'),
        ("map.json", '{"0": "tomato", "1": "leaf"}'),
    ],
)
def test_labels_files(name, text, tmp_path):
    (tmp_path / name).write_text(text)
    assert read_labels(str(tmp_path / name)) == ("tomato", "leaf")


@pytest.mark.parametrize(
    ("name", "content", "match"),
    [
        ("gone.txt", None, "No such file"),
        ("empty.txt", b"\n \n", "must hold the classes' names: got none"),
        ("bad.yaml", b"names: [", "bad.yaml: "),
        ("bad.json", b"{", "bad.json: "),
        ("number.json", b"3", "got none"),
        ("model.txt", b"\xff\xfe\x00", "must be text"),
    ],
)
def test_labels_that_are_none_say_so_in_one_line(name, content, match, tmp_path):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(ModelClassError, match=match) as refused:
        read_labels(str(tmp_path / name))
    assert "\n" not in str(refused.value)


def test_which_names_count():
    assert class_names("file", ("a", "b"), ("c", "d"), (), 2) == ("a", "b")
    assert class_names("", (), ("c", "d"), (), 2) == ("c", "d")
    assert class_names("", (), (), ("face",), 1) == ("face",)
    assert class_names("", (), (), (), 80) == COCO_NAMES
    assert class_names("", (), (), (), 3) == ("0", "1", "2")
    assert class_names("", (), (), (), None) == ()
    assert len(COCO_NAMES) == len(set(COCO_NAMES)) == 80
    with pytest.raises(ModelClassError, match="labels file must name all classes of the model, 3: got 2 names"):
        class_names("file", ("a", "b"), (), (), 3)


def test_a_person_is_asked_for_by_name(onnx_model):
    path = str(onnx_model("yolox", classes=80))
    detector = Detector(DetectorParameters(model=path, classes=("person",)))
    assert detector.classes_of(("person",)) == ("person",)
    assert detector.class_names[0] == "person"


def test_labels_name_the_classes_of_a_model_whose_count_is_not_known(onnx_model):
    path = str(onnx_model("yolov10"))
    assert Detector(DetectorParameters(model=path)).class_names == ()
    assert Detector(DetectorParameters(model=path, labels="coco")).class_names == COCO_NAMES


def test_labels_of_another_count_refuse_the_model(onnx_model, tmp_path):
    (tmp_path / "names.txt").write_text("cube\n")
    for names in (None, "['tomato', 'leaf']"):
        path = str(onnx_model("yolov6", names=names))
        with pytest.raises(ModelClassError, match="must name all classes of the model, 2: got 1 names"):
            Detector(DetectorParameters(model=path, labels=str(tmp_path / "names.txt")))
