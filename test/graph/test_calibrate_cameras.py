"""`vergence calibrate cameras`: from files on drawn and real boards, and live from topics."""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import pytest
import yaml
from sensor_msgs.msg import CompressedImage, Image
from std_msgs.msg import Header

from vergence_bringup.commands import calibrate_cameras
from vergence_bringup.ros.live_board_views import LiveViews
from vergence_camera.calibration.boards import Chessboard
from vergence_camera.calibration.views import ViewCollector
from vergence_camera.camera_info import load_calibration
from vergence_common.images import array_to_compressed, array_to_image
from vergence_common.qos import IMAGE_QOS
from vergence_common.stamps import from_nanoseconds

pytestmark = pytest.mark.graph

DATA = Path(__file__).resolve().parents[3] / "shared" / "data" / "stereo_chessboard"
Pixels = npt.NDArray[np.uint8]


def board_at(x: float, y: float, scale: float, slant: float = 0.0) -> Pixels:
    """A 6x4 chessboard drawn into a 320x240 picture."""
    squares = np.where(np.indices((5, 7)).sum(axis=0) % 2, 255, 0).astype(np.uint8)
    flat = cv2.copyMakeBorder(cv2.resize(squares, None, fx=20, fy=20, interpolation=0), 20, 20, 20, 20, 0, value=255)
    corners = np.array([[0, 0], [180, 0], [180, 140], [0, 140]], np.float32)
    target = corners * scale + (x, y)
    target[1:3, 1] += np.array([slant, -slant], np.float32)
    warp = cv2.getPerspectiveTransform(corners, target.astype(np.float32))
    drawn = cv2.warpPerspective(flat, warp, (320, 240), borderValue=255)
    return np.asarray(cv2.GaussianBlur(drawn, (0, 0), 0.8), dtype=np.uint8)


VIEWS = [(10, 10, 0.9, 8.0), (120, 20, 1.0, -9.0), (30, 80, 1.0, 12.0), (100, 60, 1.2, -14.0), (60, 20, 1.4, 10.0)]


def calibrate(*arguments: str) -> tuple[int, str]:
    parser = argparse.ArgumentParser()
    calibrate_cameras.add_arguments(parser)
    said: list[str] = []
    return calibrate_cameras.run(parser.parse_args(arguments), said.append), "\n".join(said)


def write_views(folder: Path) -> tuple[list[str], list[str]]:
    files: tuple[list[str], list[str]] = ([], [])
    for number, (x, y, scale, slant) in enumerate(VIEWS):
        for eye, shift in ((0, 0), (1, -6)):
            path = folder / f"{'left' if eye == 0 else 'right'}{number}.png"
            cv2.imwrite(str(path), board_at(x + shift, y, scale, slant))
            files[eye].append(str(path))
    return files


def test_files_of_both_eyes_give_three_yamls_and_reasons(tmp_path: Path) -> None:
    left, right = write_views(tmp_path)
    blank = tmp_path / "blank.png"
    cv2.imwrite(str(blank), np.full((240, 320), 255, np.uint8))
    broken = tmp_path / "broken.png"
    broken.write_bytes(b"no picture")
    status, text = calibrate(
        *("--left", *left, left[0], str(blank), str(broken), "--right", *right, right[0], right[0], right[0]),
        *("--board", "6x4", "--square-m", "0.02", "--out", str(tmp_path / "out")),
    )
    assert status == 0
    assert "[1/8] left0.png + right0.png: accepted" in text
    assert "shows the same as left0.png + right0.png" in text
    assert "left: no chessboard of 6x4" in text
    assert "not readable as images" in text
    assert "8 views offered, 3 rejected" in text
    assert "coverage" in text
    assert load_calibration(tmp_path / "out" / "left.yaml").width_px == 320
    stereo = yaml.safe_load((tmp_path / "out" / "stereo.yaml").read_text())
    assert set(stereo) >= {"rotation", "translation", "rms_px"}
    assert len(stereo["translation"]["data"]) == 3


def test_one_eye_alone(tmp_path: Path) -> None:
    left, _ = write_views(tmp_path)
    status, _ = calibrate("--left", *left, "--board", "6x4", "--square-m", "0.02", "--out", str(tmp_path / "out"))
    assert status == 0
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["left.yaml"]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda left, right: ["--left", *left, "--right", *right[1:]], "got 5 and 4"),
        (lambda left, right: ["--left", *left[:2]], "at least 3"),
        (lambda left, right: ["--left", *left, "--board", "six"], "COLUMNSxROWS"),
        (lambda left, right: ["--left", *left, "--square-m", "-1"], "square_m"),
        (lambda left, right: ["--left", "absent.png", "/dev/null", "/", "--square-m", "0.02"], "none of the 3 views"),
    ],
)
def test_wrong_input_is_one_line(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    change: Callable[[list[str], list[str]], list[str]],
    words: str,
) -> None:
    arguments = ["--board", "6x4", "--out", str(tmp_path / "out"), *change(*write_views(tmp_path))]
    status, _ = calibrate(*arguments)
    assert status == 2
    assert words in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.skipif(not DATA.is_dir(), reason="the chessboard pictures (../shared/data) are not here")
def test_the_published_set(tmp_path: Path) -> None:
    files = {eye: sorted(map(str, DATA.glob(f"{eye}*.jpg"))) for eye in ("left", "right")}
    status, text = calibrate(
        *("--left", *files["left"], "--right", *files["right"]),
        *("--board", "9x6", "--square-m", "0.025", "--out", str(tmp_path)),
    )
    assert status == 0, text
    stereo = yaml.safe_load((tmp_path / "stereo.yaml").read_text())
    assert max(stereo["rms_px"], stereo["left_rms_px"], stereo["right_rms_px"]) <= 0.3
    assert load_calibration(tmp_path / "left.yaml").k[0] == pytest.approx(535.9, rel=0.01)


@pytest.mark.skipif(not DATA.is_dir(), reason="the chessboard pictures (../shared/data) are not here")
def test_swapped_eyes_of_the_published_set_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = {eye: sorted(map(str, DATA.glob(f"{eye}*.jpg")))[:6] for eye in ("left", "right")}
    status, _ = calibrate(
        *("--left", *files["right"], "--right", *files["left"]),
        *("--board", "9x6", "--square-m", "0.025", "--out", str(tmp_path / "out")),
    )
    assert status == 2
    assert "the right eye must be to the right of the left one" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("compressed", [True, False])
def test_live_views_are_accepted_when_the_board_is_still_and_somewhere_new(graph: Any, compressed: bool) -> None:
    kind, suffix = (CompressedImage, "image_raw/compressed") if compressed else (Image, "image_raw")
    topics = {eye: f"{eye}/{suffix}" for eye in ("left", "right")}
    collector = ViewCollector(Chessboard(6, 4, 0.02), least_change=0.04)
    said: list[str] = []
    node = graph.add(LiveViews(collector, topics, 2, 0.02, said.append, context=graph.context))
    publishers = {eye: graph.client.create_publisher(kind, topic, IMAGE_QOS) for eye, topic in topics.items()}
    for publisher in publishers.values():
        graph.wait_until(lambda p=publisher: p.get_subscription_count() > 0, "the calibration listens")
    stamp_ns = 10**9

    def show(x: float, y: float, skew_ns: int = 0) -> None:
        nonlocal stamp_ns
        stamp_ns += 33_000_000
        seen = len(node._previous), node._offered
        for eye, publisher in publishers.items():
            late = skew_ns if eye == "right" else 0
            header = Header(stamp=from_nanoseconds(stamp_ns + late))
            pixels = cv2.cvtColor(board_at(x - 6 * (eye == "right"), y, 1.0), cv2.COLOR_GRAY2BGR)
            publisher.publish(array_to_compressed(pixels, header) if compressed else array_to_image(pixels, header))
        if not skew_ns:
            graph.wait_until(lambda: node._offered > seen[1], "the pair is looked at")

    show(20, 20)
    assert collector.views == []  # one image cannot show whether it moves
    show(20, 20)
    assert len(collector.views) == 1
    show(20, 20)
    show(60, 40)
    assert len(collector.views) == 1  # the same place; then it moved
    show(60, 40)
    assert len(collector.views) == 2
    graph.wait(node.done)
    assert "[2/2] view accepted" in said[-1]
    assert "covered" in said[-1]
    assert len(collector.verdicts) == 2
