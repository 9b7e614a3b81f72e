"""Calibrations in the standard YAML: there and back, by URL, and refused with reasons."""

from pathlib import Path

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from vergence_camera.camera_info import (
    Calibration,
    CameraCalibrationError,
    calibration_path,
    load_calibration,
    save_calibration,
)

K = (533.0, 0.0, 339.0, 0.0, 534.0, 234.0, 0.0, 0.0, 1.0)
D = (-0.29, 0.1, 0.001, -0.0005, 0.0)

# As ROS's calibrators write it.
STANDARD = """\
image_width: 640
image_height: 480
camera_name: left
camera_matrix:
  rows: 3
  cols: 3
  data: [438.78356, 0., 305.59336, 0., 437.35, 243.73, 0., 0., 1.]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.361976, 0.110510, 0.001014, 0.000505, 0.000000]
rectification_matrix:
  rows: 3
  cols: 3
  data: [0.999978, 0.002789, -0.006046, -0.002816, 0.999986, -0.004401, 0.006034, 0.004417, 0.999972]
projection_matrix:
  rows: 3
  cols: 4
  data: [393.6538, 0., 322.7976, 0., 0., 393.6538, 241.0909, 0., 0., 0., 1., 0.]
"""


def test_reads_what_the_ros_calibrators_write(tmp_path: Path) -> None:
    path = tmp_path / "left.yaml"
    path.write_text(STANDARD)
    calibration = load_calibration(path)
    assert (calibration.width_px, calibration.height_px, calibration.name) == (640, 480, "left")
    assert (calibration.k[0], calibration.d[0], calibration.r[2], calibration.p[5]) == (
        *(438.78356, -0.361976, -0.006046, 393.6538),
    )


@settings(deadline=None, max_examples=40)
@given(
    st.lists(st.floats(-0.02, 0.02, allow_subnormal=False), min_size=5, max_size=5),
    st.floats(500.0, 5000.0),
    st.integers(500, 5000),
    st.text(st.characters(codec="utf-8", exclude_categories=("Cc", "Cs", "Zl", "Zp")), min_size=1, max_size=12),
)
def test_there_and_back(
    tmp_path_factory: pytest.TempPathFactory, d: list[float], f: float, width: int, name: str
) -> None:
    calibration = Calibration(width, 480, (f, *K[1:]), tuple(d), name=name)
    path = tmp_path_factory.mktemp("calibration") / "a" / "b.yaml"
    save_calibration(calibration, path)
    assert load_calibration(path) == calibration
    assert [file.name for file in path.parent.iterdir()] == ["b.yaml"]


@pytest.mark.parametrize("changed", [{"k": (1.0, *K[1:])}, {"d": (1e308, *D[1:])}, {"d": (*D[:4], 1e-310)}])
def test_numbers_that_no_lens_has_are_refused_by_the_cameras_name(changed: dict[str, tuple[float, ...]]) -> None:
    values = {"k": K, "d": D} | changed
    with pytest.raises(CameraCalibrationError, match=r"left_webcam: (fx|distortion) must be"):
        Calibration(640, 480, values["k"], values["d"], name="left_webcam")


def test_a_monocular_projection_is_filled_in() -> None:
    assert Calibration(640, 480, K, D).p == (533.0, 0.0, 339.0, 0.0, 0.0, 534.0, 234.0, 0.0, 0.0, 0.0, 1.0, 0.0)


@pytest.mark.parametrize(
    ("entry", "value", "text"),
    [
        ("image_width", "640px", "whole number"),
        ("image_height", 0, "at least 1x1"),
        ("camera_matrix", {"data": [1.0, 2.0]}, "9 finite numbers"),
        ("camera_matrix", {"rows": 3, "cols": 3}, "'data'"),
        ("camera_matrix", {"data": [0.0] * 9}, "focal lengths"),
        ("distortion_model", "fisheye", "'plumb_bob', 'rational_polynomial', 'equidistant'"),
        ("distortion_coefficients", {"data": [0.1, float("nan"), 0, 0, 0]}, "finite"),
        ("distortion_coefficients", {"data": [0.1] * 7}, "4 or 5"),
        ("projection_matrix", {"data": ["a"] * 12}, "numbers"),
    ],
)
def test_wrong_entries_are_named(tmp_path: Path, entry: str, value: object, text: str) -> None:
    document = yaml.safe_load(STANDARD)
    document[entry] = value
    path = tmp_path / "wrong.yaml"
    path.write_text(yaml.safe_dump(document))
    with pytest.raises(CameraCalibrationError) as caught:
        load_calibration(path)
    assert str(path) in str(caught.value)
    assert text in str(caught.value)


@pytest.mark.parametrize("content", ["", "[1, 2]", "a: [", "\x00"])
def test_files_that_are_no_calibration(tmp_path: Path, content: str) -> None:
    path = tmp_path / "wrong.yaml"
    path.write_text(content)
    with pytest.raises(CameraCalibrationError, match=r"wrong\.yaml"):
        load_calibration(path)


def test_a_missing_file(tmp_path: Path) -> None:
    with pytest.raises(CameraCalibrationError, match="cannot be read"):
        load_calibration(tmp_path / "none.yaml")


def share(package: str) -> str:
    if package != "my_rig":
        raise LookupError(package)
    return "/opt/share/my_rig"


@pytest.mark.parametrize(
    ("url", "path"),
    [
        ("file:///etc/cal/left.yaml", "/etc/cal/left.yaml"),
        ("file:///etc/a%20b.yaml", "/etc/a b.yaml"),
        ("package://my_rig/config/left.yaml", "/opt/share/my_rig/config/left.yaml"),
        ("file://${ROS_HOME}/x/${NAME}.yaml", "/home/ros/x/left.yaml"),
        ("", "/home/ros/camera_info/left.yaml"),
    ],
)
def test_urls(monkeypatch: pytest.MonkeyPatch, url: str, path: str) -> None:
    monkeypatch.setenv("ROS_HOME", "/home/ros")
    assert calibration_path(url, "left", share) == Path(path)


@pytest.mark.parametrize(
    "url", ["left.yaml", "http://x/y.yaml", "package://other/x.yaml", "file://host/x", "package://"]
)
def test_other_urls_are_refused(url: str) -> None:
    with pytest.raises(CameraCalibrationError, match="camera_info_url"):
        calibration_path(url, "left", share)


def test_an_unwritable_place_leaves_nothing_behind(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    with pytest.raises(FileExistsError):
        save_calibration(Calibration(640, 480, K, D), tmp_path / "file" / "left.yaml")
    assert [entry.name for entry in tmp_path.iterdir()] == ["file"]


@pytest.mark.parametrize("name", ["", "../x", "a/b", ".hidden", "/etc/passwd"])
def test_a_camera_name_stays_in_its_folder(name: str) -> None:
    with pytest.raises(CameraCalibrationError, match="camera_name must be a name"):
        calibration_path("", name, lambda package: "/share")


def test_a_url_stays_in_its_package() -> None:
    with pytest.raises(CameraCalibrationError, match="must lead into its package"):
        calibration_path("package://some/../../etc/x.yaml", "left", lambda package: "/share")


def test_a_file_that_is_no_calibration_is_kept_beside_the_new_one(tmp_path: Path) -> None:
    path = tmp_path / "left.yaml"
    path.write_text(STANDARD)
    calibration = load_calibration(path)
    path.write_text("my own notes\n")
    save_calibration(calibration, path)
    assert (tmp_path / "left.yaml.bak").read_text() == "my own notes\n"
    save_calibration(calibration, path)
    assert sorted(file.name for file in tmp_path.iterdir()) == ["left.yaml", "left.yaml.bak"]
