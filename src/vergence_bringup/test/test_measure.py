"""`vergence measure`: the paper's flowchart on stored images, through the command line."""

import json
import math
from pathlib import Path

import cv2
import numpy as np
import pytest

from vergence_bringup.command_line import main
from vergence_metric.boxes import Box, BoxStatus, BoxVergenceResult, Detections
from vergence_metric.boxes.corner_metric import corner_metric

EYES = ("left", "right")
DATA = Path(__file__).resolve().parents[4] / "shared" / "data" / "stereo_chessboard"


def brute_force(from_mask, to_mask):
    a, b = np.argwhere(from_mask), np.argwhere(to_mask)
    if not len(a) or not len(b):
        return None
    squares = ((a[:, None, :] - b[None, :, :]) ** 2).sum(axis=2)
    return float(np.sqrt(squares.min(axis=1)).mean())


def check(figures, out):
    left, right = (np.asarray(cv2.imread(str(out / f"{eye}_edges.png"), cv2.IMREAD_GRAYSCALE)) for eye in EYES)
    h, w = left.shape
    for i, size in enumerate(figures["windows_px"]):
        rows = slice(h // 2 - size // 2, h // 2 - size // 2 + size)
        columns = slice(w // 2 - size // 2, w // 2 - size // 2 + size)
        a, b = left[rows, columns], right[rows, columns]
        assert figures["left_to_right_px"][i] == pytest.approx(brute_force(a, b), abs=1e-9)
        assert figures["right_to_left_px"][i] == pytest.approx(brute_force(b, a), abs=1e-9)


@pytest.fixture
def pair(tmp_path):
    rng = np.random.default_rng(5)
    scene = cv2.resize(rng.integers(0, 255, (30, 44), dtype=np.uint8), (660, 450), interpolation=cv2.INTER_CUBIC)
    paths = tmp_path / "left.png", tmp_path / "right.png"
    cv2.imwrite(str(paths[0]), scene[:401, 10:631])
    cv2.imwrite(str(paths[1]), scene[:401, 14:635])
    return [str(path) for path in paths]


def test_json_is_the_definition_on_the_edge_images_it_saves(pair, tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["measure", *pair, "--out", str(out), "--json"]) == 0
    figures = json.loads(capsys.readouterr().out)
    assert figures["windows_px"] == [50, 100, 150, 200, 250, 300]
    check(figures, out)
    assert (out / "combined_edges.png").is_file()


def test_the_table_has_a_row_a_window(pair, capsys):
    assert main(["measure", *pair, "--windows", "64", "128"]) == 0
    text = capsys.readouterr().out
    assert "64x64" in text
    assert "128x128" in text
    assert text.count(" px") == 4


def test_a_blank_pair_is_null_and_no_edges(tmp_path, capsys):
    path = tmp_path / "blank.png"
    cv2.imwrite(str(path), np.full((120, 160), 90, np.uint8))
    assert main(["measure", str(path), str(path), "--windows", "50", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["left_to_right_px"] == [None]
    assert main(["measure", str(path), str(path), "--windows", "50"]) == 0
    assert "no edges" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("left", "right", "words"),
    [
        ("absent.png", None, "absent.png"),
        ("text.png", None, "text.png"),
        (None, "small.png", "small"),
    ],
)
def test_bad_input_is_one_line_and_status_2(pair, tmp_path, capsys, left, right, words):
    (tmp_path / "text.png").write_text("no picture")
    cv2.imwrite(str(tmp_path / "small.png"), np.zeros((20, 30, 3), np.uint8))
    arguments = [str(tmp_path / left) if left else pair[0], str(tmp_path / right) if right else pair[1]]
    assert main(["measure", *arguments]) == 2
    error = capsys.readouterr().err
    assert error.startswith("vergence measure: ")
    assert error.count("\n") == 1
    assert words in error or "(20, 30)" in error


@pytest.fixture
def models(monkeypatch):
    """Stand in for the detector with a pair of boxes, of which the right one is cut; returns what models were asked."""
    asked: list[str] = []
    boxes = (
        Box((40.0, 50.0, 140.0, 150.0), 0.9, 0, "cube"),
        Box((28.0, 48.0, 128.0, 148.5), 0.8, 0, "cube", (True, False, False, False)),
    )
    nothing = Detections(np.zeros((0, 4)), np.zeros(0), np.zeros(0, np.int64), (), (621, 401))

    def measure_pair(left, right, model, parameters):
        asked.append(model)
        return BoxVergenceResult(
            BoxStatus.CUT, "a box is cut", nothing, nothing, *boxes, corner_metric(*boxes), center_px=(math.nan, 1.75)
        )

    monkeypatch.setattr("vergence_metric.boxes.measure_pair", measure_pair)
    return asked


def test_a_model_adds_metric_ii_both_ways_with_null_for_a_cut_side(pair, models, tmp_path, capsys):
    assert main(["measure", *pair, "--model", "some.onnx", "--json", "--out", str(tmp_path)]) == 0
    figures = json.loads(capsys.readouterr().out, parse_constant=pytest.fail)
    assert models == ["some.onnx"]
    box = figures["box"]
    assert (box["class"], box["status"], box["reason"]) == ("cube", "cut", "a box is cut")
    assert box["left_minus_right_px"] == [None, 2.0, 12.0, 1.5]
    assert box["right_minus_left_px"] == [None, -2.0, -12.0, -1.5]
    assert box["center_px"] == [None, 1.75]
    assert box["scores"] == [0.9, 0.8]
    assert box["right_xyxy_px"] == [28.0, 48.0, 128.0, 148.5]
    assert box["left_point_px"] == [90.0, 100.0]
    assert figures["windows_px"]
    picture = cv2.imread(str(tmp_path / "boxes.png"))
    assert picture is not None
    assert picture.shape == (401, 2 * 621, 3)


def test_the_table_ends_with_the_boxes(pair, models, capsys):
    assert main(["measure", *pair, "--model", "shipped"]) == 0
    assert models == [""]
    text = capsys.readouterr().out
    assert "cube: cut (a box is cut), scores 0.90 left, 0.80 right" in text
    assert "(-, +2.00) (+12.00, +1.50)" in text
    assert "(-, -2.00) (-12.00, -1.50)" in text


def test_the_shipped_detector_sees_no_cube_in_noise(pair, capsys):
    assert main(["measure", *pair, "--model", "shipped"]) == 0
    assert "boxes: no target" in capsys.readouterr().out


@pytest.mark.parametrize(("model", "words"), [("absent.onnx", "no such file"), ("text.onnx", "ONNX"), ("", "--model")])
def test_a_bad_model_is_one_line_and_nothing_is_printed(pair, tmp_path, capsys, model, words):
    (tmp_path / "text.onnx").write_text("no network")
    assert main(["measure", *pair, "--model", model and str(tmp_path / model)]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith("vergence measure: ")
    assert printed.err.count("\n") == 1
    assert words in printed.err


def built(folder, layout, **options):
    pytest.importorskip("onnx", reason="the onnx package is not installed: pip install onnx")
    from vergence_metric.testing.onnx_detectors import build_detector

    return str(build_detector(folder / "model.onnx", layout, **options))


def red_cell(folder, x):
    image = np.zeros((96, 128, 3), np.uint8)
    image[16:32, x : x + 16, 2] = 255
    path = folder / f"cell_{x}.png"
    cv2.imwrite(str(path), image)
    return str(path)


def test_layout_and_labels_of_a_model_that_names_neither(tmp_path, capsys):
    pair, model = (red_cell(tmp_path, 48), red_cell(tmp_path, 32)), built(tmp_path, "yolov8_rows")
    command = ["measure", *pair, "--windows", "50", "--json", "--model", model]
    assert main(command) == 2
    assert "say which by the parameter 'detector.layout'" in capsys.readouterr().err
    assert main([*command, "--layout", "yolov8_rows"]) == 0
    box = json.loads(capsys.readouterr().out)["box"]
    assert (box["class"], box["center_px"][0]) == ("0", pytest.approx(16.0, abs=1e-3))
    (tmp_path / "names.txt").write_text("tomato\nleaf\n")
    assert main([*command, "--labels", str(tmp_path / "names.txt")]) == 0
    assert json.loads(capsys.readouterr().out)["box"]["class"] == "tomato"


def test_the_point_of_a_face_is_between_its_eyes(tmp_path, capsys):
    pair, model = (red_cell(tmp_path, 48), red_cell(tmp_path, 32)), built(tmp_path, "yunet")
    assert main(["measure", *pair, "--windows", "50", "--json", "--model", model]) == 0
    box = json.loads(capsys.readouterr().out)["box"]
    assert box["class"] == "face"
    # The built faces have their eyes a fifth of a cell below the cell's top.
    assert box["left_point_px"] == pytest.approx([55.5, 18.7], abs=1e-3)
    assert box["right_point_px"] == pytest.approx([39.5, 18.7], abs=1e-3)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--layout", "yolov8"), "--layout needs --model FILE"),
        (("--labels", "coco"), "--labels needs --model FILE"),
        (("--model", "shipped", "--layout", "yolov3"), "'layout' must be one of 'auto', 'yolov6'"),
        (("--model", "shipped", "--labels", "gone.txt"), "labels gone.txt"),
        (("--model", "shipped", "--labels", "coco"), "labels coco must name all classes of the model, 1: got 80"),
    ],
)
def test_options_that_do_not_fit_are_one_line(pair, capsys, arguments, words):
    assert main(["measure", *pair, *arguments]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.count("\n") == 1
    assert words in printed.err


@pytest.mark.skipif(not DATA.is_dir(), reason="the real pairs (../shared/data/stereo_chessboard) are not here")
@pytest.mark.parametrize("number", [1, 4])
def test_real_pairs(number, tmp_path, capsys):
    pair = [str(DATA / f"{eye}0{number}.jpg") for eye in ("left", "right")]
    assert main(["measure", *pair, "--out", str(tmp_path), "--json", "--windows", "50", "100"]) == 0
    check(json.loads(capsys.readouterr().out), tmp_path)


def test_the_papers_table_has_the_shapes_both_directions_and_the_two_lists(pair, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["measure", *pair, "--json"]) == 0
    figures = json.loads(capsys.readouterr().out)
    assert main(["measure", *pair, "--paper"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "images (401, 621, 3) (401, 621, 3), edges (401, 621) (401, 621)"
    there, back = ([f"{value:.4f}" for value in figures[f"{way}_px"]] for way in ("left_to_right", "right_to_left"))
    for i, size in enumerate(figures["windows_px"]):
        rows = lines[1 + 3 * i : 4 + 3 * i]
        assert rows[0] == f"{size}x{size}: shapes ({size}, {size}) ({size}, {size})"
        assert rows[1:] == [f"  left to right {there[i]}", f"  right to left {back[i]}"]
    assert lines[19:21] == [f"left to right: [{', '.join(there)}]", f"right to left: [{', '.join(back)}]"]
    saved = {path.name for path in (tmp_path / "paper").iterdir()}
    assert saved == {
        *(f"{name}.png" for name in ("left", "right", "left_edges", "right_edges", "combined_edges", "boxes")),
    }
    taken, kept = cv2.imread(pair[0]), cv2.imread(str(tmp_path / "paper" / "left.png"))
    assert kept is not None
    assert taken is not None
    assert np.array_equal(kept, taken)


def test_the_papers_table_without_a_detector_says_so(pair, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    assert main(["measure", *pair, "--paper", "--out", str(tmp_path / "out")]) == 0
    assert "no boxes: onnxruntime is not installed" in capsys.readouterr().out
    assert not (tmp_path / "out" / "boxes.png").exists()
    assert main(["measure", *pair, "--paper", "--json"]) == 2
