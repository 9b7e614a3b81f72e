"""The demo before photographs: what is given, where it clicks, what the stations and the report say."""

import dataclasses
import json
import math
import sys

import cv2
import numpy as np
import pytest

from vergence_bringup.command_line import main
from vergence_bringup.demo.click_points import click_points, least_gradient
from vergence_bringup.demo.photo_report import write_overview
from vergence_bringup.demo.photographs import MATCHED, MEASURED, UNKNOWN, Photographs, open_photographs
from vergence_bringup.demo.report import write_report
from vergence_bringup.demo.result import StationResult, summary, table, unfinished
from vergence_bringup.figures.pictures import read_image
from vergence_rig.geometry import EyeAngles
from vergence_rig.install_hint import install_hint
from vergence_rig.rig import default_rig
from vergence_sim.photo.pair import PhotoPair

SIZE = 300, 400
DISPARITY_PX = 24


def textured(seed=0, shape=SIZE):
    noise = cv2.GaussianBlur(np.random.default_rng(seed).normal(0, 1, (*shape, 3)), (0, 0), 2)
    return np.clip(128 + 50 * noise / noise.std(), 0, 255).astype(np.uint8)


def shifted(image):
    """Return what a right eye sees of a flat scene: x_left - x_right is DISPARITY_PX."""
    return np.roll(image, -DISPARITY_PX, axis=1)


@pytest.fixture
def paths(tmp_path):
    left = textured()
    names = [str(tmp_path / "left.png"), str(tmp_path / "right.png")]
    for name, image in zip(names, (left, shifted(left)), strict=True):
        cv2.imwrite(name, image)
    return names


@pytest.fixture
def photographs(tmp_path):
    """A flat scene whose upper half has a known disparity."""
    left = textured()
    disparity = np.full(SIZE, float(DISPARITY_PX))
    disparity[SIZE[0] // 2 :] = np.nan
    pair = PhotoPair(left, shifted(left))
    return Photographs((tmp_path / "left.png", tmp_path / "right.png"), pair, disparity, MEASURED)


@pytest.mark.parametrize("count", [1, 3, 5, 6])
def test_points_are_spread_and_away_from_the_border(count):
    points = np.array(click_points(textured(), count))
    assert len(points) == count
    assert points[:, 0].min() >= 0.15 * SIZE[1] - 1
    assert points[:, 0].max() <= 0.9 * SIZE[1] + 1
    assert points[:, 1].min() >= 0.1 * SIZE[0] - 1
    assert points[:, 1].max() <= 0.9 * SIZE[0] + 1
    apart = np.linalg.norm(points[:, None] - points, axis=2)[~np.eye(count, dtype=bool)]
    assert apart.min(initial=math.inf) >= 0.1 * SIZE[1]


def test_points_are_where_there_is_texture():
    image = np.full((*SIZE, 3), 128, np.uint8)
    image[60:160, 200:300] = textured()[60:160, 200:300]
    ((x, y),) = click_points(image, 1)
    assert 190 < x < 310
    assert 50 < y < 170
    assert all(190 < x < 310 and 50 < y < 170 for x, y in click_points(image, 6))


def test_an_edge_alone_is_no_texture():
    image = np.zeros((*SIZE, 3), np.uint8)
    image[:, 200:] = 255
    assert least_gradient(image).max() < 0.1
    assert click_points(image, 6) == []


def test_a_large_picture_gives_its_own_pixels():
    small = np.full((*SIZE, 3), 128, np.uint8)
    small[60:100, 200:240] = textured()[60:100, 200:240]
    large = cv2.resize(small, None, fx=4.0, fy=4.0, interpolation=cv2.INTER_CUBIC)
    ((x, y),) = click_points(np.asarray(large, np.uint8), 1)
    assert (x / 4, y / 4) == pytest.approx((220, 80), abs=25)


def test_given_photographs_are_matched(paths, tmp_path):
    found = open_photographs(paths, tmp_path)
    assert found.source == MATCHED
    assert len(found.points) == 6
    known = [point.disparity_px for point in found.points if point.depth_known]
    assert len(known) >= 4
    assert known == pytest.approx([DISPARITY_PX] * len(known), abs=0.3)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (["left.png"], "--photos must be followed by two paths, LEFT RIGHT, or by none: got 1 (left.png)"),
        (["left.png", "right.png", "a.png"], "or by none: got 3"),
        (["nowhere.png", "right.png"], "the left photograph 'nowhere.png' cannot be read: No such file"),
        (["left.png", "text.png"], "the right photograph 'text.png' is not a picture that OpenCV can decode"),
        (["left.png", "small.png"], "both photographs must have one size: left is 400x300, right is 80x60 px"),
        (["small.png", "small.png"], "the photographs must be at least 120 px wide and high: got 80x60 px"),
        (["blank.png", "blank.png"], "the left photograph must have texture somewhere"),
    ],
)
@pytest.mark.usefixtures("paths")
def test_what_cannot_be_shown_is_said_before_anything_starts(given, words, tmp_path, monkeypatch, capsys):
    cv2.imwrite(str(tmp_path / "small.png"), textured(shape=(60, 80)))
    cv2.imwrite(str(tmp_path / "blank.png"), np.full((*SIZE, 3), 90, np.uint8))
    (tmp_path / "text.png").write_text("not a picture")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("vergence_bringup.demo.ros.command._run", pytest.fail)
    assert main(["demo", "--out", "out", "--photos", *given]) == 2
    printed = capsys.readouterr()
    assert words in printed.err
    assert len(printed.err.splitlines()) == 1


def test_without_scikit_image_one_sentence_says_what_to_do(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "skimage.data", None)
    assert main(["demo", "--out", str(tmp_path), "--photos"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert install_hint("scikit-image") in line
    assert "LEFT RIGHT" in line


def test_a_station_that_is_not_a_point_is_refused(paths, tmp_path, capsys):
    assert main(["demo", "--out", str(tmp_path), "--station", "cube_moving", "--photos", *paths]) == 2
    assert "--station must be one of point_1, point_2" in capsys.readouterr().err


def test_the_node_gets_points_of_known_and_of_unknown_depth(photographs):
    values = photographs.parameters
    known, rays = np.reshape(values["points_px"], (-1, 3)), np.reshape(values["rays_px"], (-1, 2))
    assert (len(known), len(rays)) == (3, 3)
    assert known[:, 1].max() < SIZE[0] / 2 <= rays[:, 1].min()
    assert set(known[:, 2]) == {DISPARITY_PX}
    assert [photographs.number_of(point) for point in photographs.points] == [0, 1, 2, 3, 4, 5]


def test_a_disparity_that_leaves_the_right_photograph_is_not_known(tmp_path):
    left = textured()
    found = Photographs((tmp_path, tmp_path), PhotoPair(left, left), np.full(SIZE, 200.0), MEASURED)
    assert [point.depth_known for point in found.points] == [point.x_px >= 200 for point in found.points]


def test_every_station_starts_where_the_left_eye_sees_its_point(photographs):
    rig = default_rig()
    for station, point in zip(photographs.stations(rig), photographs.points, strict=True):
        assert photographs.point_of(station) == point
        assert (station.moving, station.has_boxes, station.start_vergence_deg) == (False, False, 0.0)
        wanted = photographs.pair.fixation(point)
        aside = math.degrees(wanted.pan_left_rad) - station.start_version_deg
        assert abs(math.tan(math.radians(aside)) * rig.left_camera.fx_px) < 240 - 40
        assert (f"{DISPARITY_PX}.0 px, by {MEASURED}" if point.depth_known else UNKNOWN) in station.title


def outcome(photographs, number, off_px=0.0):
    """Return a station's result with the eyes on its point, the right one `off_px` beside it."""
    station = photographs.stations(default_rig())[number]
    point = photographs.points[number]
    exact = photographs.pair.fixation(dataclasses.replace(point, disparity_px=DISPARITY_PX))
    off_rad = off_px / photographs.pair.fx_px
    angles = EyeAngles(exact.pan_left_rad, exact.pan_right_rad + off_rad, exact.tilt_rad)
    return dataclasses.replace(
        unfinished(station, ""),
        reported_verged=True,
        time_s=0.4,
        true_error_deg=math.degrees(off_rad) if point.depth_known else math.nan,
        off_axis_deg=0.2,
        tolerance_deg=0.75,
        off_axis_tolerance_deg=2.6,
        photo=photographs.figures(station, angles),
        answer="VERGED",
        answer_s=0.7,
    )


def test_the_eyes_rest_on_pixels_of_the_photographs(photographs):
    figures = outcome(photographs, 0, off_px=3.0).photo
    assert figures is not None
    point = photographs.points[0]
    assert figures.rests_px[0] == pytest.approx((point.x_px, point.y_px))
    assert figures.verged_disparity_px == pytest.approx(DISPARITY_PX + 3.0, abs=1.0)


def test_where_the_disparity_is_not_known_only_the_left_eye_is_judged(photographs):
    known, unknown = outcome(photographs, 0), outcome(photographs, 5)
    assert (known.truth_text, unknown.truth_text) == ("agrees", "left agrees")
    assert known.passed
    assert unknown.passed
    assert not dataclasses.replace(unknown, off_axis_deg=3.0).passed
    assert not dataclasses.replace(known, true_error_deg=math.nan).passed
    assert "left agrees" in table([unknown])


def test_summary_and_report_say_what_is_known_and_what_is_not(photographs, tmp_path):
    results: list[StationResult] = [outcome(photographs, 0), outcome(photographs, 5)]
    settings = {
        "servo": "sg90",
        "cameras": "realistic",
        "duration_s": 1.0,
        "photographs": photographs.as_json(),
    }
    stored = json.loads(json.dumps(summary(results, settings), allow_nan=False))
    assert stored["photographs"]["disparities_from"] == MEASURED
    first, last = stored["stations"]
    assert first["photo"]["disparity_px"] == DISPARITY_PX
    assert first["photo"]["verged_disparity_px"] == pytest.approx(DISPARITY_PX)
    assert (first["result"], first["result_s"]) == ("VERGED", 0.7)
    assert (last["photo"]["disparity_px"], last["photo"]["disparity_from"]) == (None, UNKNOWN)
    write_overview(photographs.pair, results, tmp_path / "pictures")
    write_report(tmp_path / "report.html", results, settings, tmp_path)
    text = (tmp_path / "report.html").read_text()
    assert text.count("data:image/") == 2
    assert "Not measured:" in text
    assert "structured light" in text
    assert "left agrees" in text


def test_the_overview_marks_what_was_clicked_in_both_photographs(photographs, tmp_path):
    write_overview(photographs.pair, [outcome(photographs, 0)], tmp_path)
    point = photographs.points[0]
    for eye, x in (("left", point.x_px), ("right", point.x_px - DISPARITY_PX)):
        drawn = read_image(tmp_path / f"photographs_{eye}.jpg")
        photograph = photographs.pair.left if eye == "left" else photographs.pair.right
        changed = np.argwhere(np.abs(drawn.astype(int) - photograph).max(axis=2) > 90)
        assert np.abs(changed - (point.y_px, x)).max(axis=1).min() < 12
