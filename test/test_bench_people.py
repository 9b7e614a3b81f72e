"""The photographs of faces of the benchmark `people`, and one goal before them: the gaze rests between the eyes."""

import math

import numpy as np
import pytest

pytest.importorskip("onnx", reason="the onnx package is not installed: pip install onnx")
pytest.importorskip("skimage", reason="scikit-image is not installed: pip install scikit-image")

from pathlib import Path

from bench import people_layouts, people_point
from vergence_metric.boxes import Detector
from vergence_metric.boxes.parameters import DetectorParameters
from vergence_metric.testing.face_panels import FacePanel, PanelView
from vergence_metric.testing.face_pictures import astronaut
from vergence_metric.testing.onnx_face_matcher import build_face_matcher
from vergence_rig.testing.ideal_eyes import gaze_for_point


@pytest.fixture(scope="module")
def detector(tmp_path_factory: pytest.TempPathFactory) -> Detector:
    path: Path = build_face_matcher(tmp_path_factory.mktemp("model") / "face.onnx", astronaut())
    return Detector(DetectorParameters(model=str(path)), threads=2)


@pytest.mark.parametrize(("distance_m", "gain", "roll_rad"), [(0.6, 1.1, 0.1), (1.0, 0.6, -0.15), (1.8, 1.0, 0.0)])
def test_the_built_detector_finds_between_the_eyes(
    detector: Detector, distance_m: float, gain: float, roll_rad: float
) -> None:
    view, place = PanelView(1), (distance_m, 0.1 * distance_m, -0.05 * distance_m)
    eyes = gaze_for_point((distance_m, 0.0, 0.0), view.rig.baseline_m)
    (image, _), _ = view.images([FacePanel(astronaut(), place, 0.15, roll_rad, gain)], eyes)
    (face,) = detector.detect(image)
    assert face.class_name == "face"
    true_px = view.pixels(True, eyes, np.array([place]))[0]
    assert math.degrees(math.dist(face.point_px, true_px) / view.cameras[0].fx_px) < 0.35


def test_a_goal_for_a_face_rests_between_its_eyes(detector: Detector) -> None:
    said: list[str] = []
    end = people_point._looked(detector, 1, said.append)
    assert end.verged, said
    assert math.degrees(end.off_rad) < 0.35, said


def test_every_family_is_recognised() -> None:
    rows = {row.what: row.value for row in people_layouts.rows(lambda text: None)}
    assert rows == {"people.layout_told": 1.0, "people.layout_refused": 0.0}
