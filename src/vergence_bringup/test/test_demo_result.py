"""The demo's verdict, table, summary and report."""

import dataclasses
import json
import math

import cv2
import numpy as np
import pytest

from vergence_bringup.demo.report import write_report
from vergence_bringup.demo.result import MetricTable, Series, StationResult, summary, table, unfinished, write_summary
from vergence_bringup.demo.stations import cube_held, marker_80_80, stations
from vergence_bringup.figures.boxes import BoxFigures
from vergence_bringup.figures.pictures import read_image

SETTINGS = {"servo": "sg90", "cameras": "realistic", "duration_s": 1.0}


@pytest.fixture
def result():
    time_s = np.linspace(0, 1, 5)
    metric = MetricTable([50, 100], [1.0, math.nan], [2.0, 3.0], [0.3, 0.4])
    return StationResult(
        "cube",
        "a cube",
        False,
        True,
        "",
        0.5,
        0.2,
        0.5,
        0.75,
        2.6,
        metric,
        metric,
        (1.0, 0.0, 0.0),
        (1.0, 0, 0),
        Series(*[time_s] * 12),
    )


@pytest.fixture
def boxes():
    return BoxFigures(
        "cut",
        "a box is cut",
        "cube",
        (math.nan, 2.0, 12.0, -0.0),
        (math.nan, 1.0),
        (11.5, 0.25),
        (0.75, 0.5),
        (0.0, 1.0, 2.0, 3.0),
        (4.0, 5.0, 6.0, 7.0),
    )


@pytest.mark.parametrize(
    ("changes", "passed"),
    [
        ({}, True),
        ({"reported_verged": False}, False),
        ({"true_error_deg": 0.76}, False),
        ({"true_error_deg": math.nan}, False),
        ({"off_axis_deg": 2.7}, False),
        ({"off_axis_deg": math.nan}, False),
    ],
)
def test_a_station_passes_only_if_graph_and_truth_agree(result, changes, passed):
    changed = dataclasses.replace(result, **changes)
    assert changed.passed is passed
    assert summary([result, changed], SETTINGS)["passed"] is passed


def test_no_station_is_no_success():
    assert summary([], SETTINGS)["passed"] is False


def test_summary_is_strict_json_with_null_for_what_is_not_known(result, tmp_path):
    path = tmp_path / "demo" / "summary.json"
    write_summary(path, [dataclasses.replace(result, time_s=math.nan)], SETTINGS)
    station = json.loads(path.read_text(), parse_constant=pytest.fail)["stations"][0]
    assert station["name"] == "cube"
    assert station["verged"] is True
    assert station["time_s"] is None
    assert station["left_to_right_px"] == {"start": [1.0, None], "end": [1.0, None]}
    assert station["right_to_left_px"]["end"] == [2.0, 3.0]


def test_table_has_every_window_and_both_directions(result):
    text = table([result, dataclasses.replace(result, reported_verged=False, reason="lost")])
    assert "NOT VERGED" in text
    assert "lost" in text
    assert text.count("L to R") == 4
    assert "3.00" in text


def test_metric_ii_stands_beside_metric_i(result, boxes):
    with_boxes = dataclasses.replace(result, start_box=boxes, end_box=None)
    station = summary([with_boxes], SETTINGS)["stations"][0]
    assert station["left_to_right_px"]["start"] == [1.0, None]
    assert station["box"]["end"] is None
    start = station["box"]["start"]
    assert (start["class"], start["status"], start["scores"]) == ("cube", "cut", [0.75, 0.5])
    assert start["left_minus_right_px"] == [None, 2.0, 12.0, 0.0]
    assert start["right_minus_left_px"] == [None, -2.0, -12.0, 0.0]
    json.dumps(station, allow_nan=False)
    text = table([with_boxes])
    assert "boxes start cube: cut 0.75/0.50" in text
    assert "L-R (-, +2.00) (+12.00, +0.00)" in text
    assert "R-L (-, -2.00) (-12.00, +0.00)" in text
    assert "surface +11.50" in text
    assert summary([result], SETTINGS)["stations"][0]["box"] == {"start": None, "end": None}
    assert "boxes" not in table([result])


def test_a_station_that_came_to_nothing_has_its_reason_everywhere(tmp_path):
    station = stations(0.065)[0]
    result = unfinished(station, "timeout after 5 s waiting for <images>")
    assert not result.passed
    assert "waiting" in table([result])
    write_summary(tmp_path / "summary.json", [result], SETTINGS)
    stored = json.loads((tmp_path / "summary.json").read_text(), parse_constant=pytest.fail)
    assert stored["passed"] is False
    assert stored["stations"][0]["reason"] == result.reason
    assert stored["stations"][0]["left_to_right_px"] == {"start": [], "end": []}
    write_report(tmp_path / "report.html", [result], SETTINGS, tmp_path)
    assert "waiting for &lt;images&gt;" in (tmp_path / "report.html").read_text()


def test_report_carries_its_pictures_and_plots(result, boxes, tmp_path):
    pictures = tmp_path / "pictures"
    pictures.mkdir()
    for moment in ("start", "end"):
        for kind in ("left.jpg", "right.jpg", "left_edges.png", "right_edges.png", "combined.png"):
            cv2.imwrite(str(pictures / f"cube_{moment}_{kind}"), np.zeros((8, 8, 3), np.uint8))
    write_report(tmp_path / "report.html", [dataclasses.replace(result, end_box=boxes)], SETTINGS, tmp_path)
    text = (tmp_path / "report.html").read_text()
    assert text.count("data:image/") == 11  # the overview and each picture
    assert text.count("<svg") == 3
    assert text.count("<polyline") >= 8
    assert "end, left &minus; right [px]</td><td>-</td><td>+2.00</td><td>+12.00</td>" in text
    assert "http" not in text


def test_stations_are_what_the_paper_and_the_promise_say():
    every = stations(0.065)
    assert len({station.name for station in every}) == len(every) == 8
    free = [station for station in every if station.mode == "both_eyes" and not station.by_class]
    assert sum(station.moving for station in free) == 1
    places = [station.place_m for station in free if station.place_m is not None]
    distances = [np.linalg.norm(place) for place in places]
    assert len(places) == 5
    assert min(distances) >= 0.3
    assert max(distances) <= 2.0
    assert any(place[2] > 0.1 for place in places)
    assert {station.name for station in stations(0.065, short=True)} < {station.name for station in every}


def test_the_distractor_is_nearer_than_the_target():
    (station,) = (station for station in stations(0.065) if station.by_class)
    assert station.has_boxes
    assert station.distractor_m is not None
    assert station.place_m is not None
    target, distractor = np.array(station.place_m), np.array(station.distractor_m)
    assert np.linalg.norm(distractor) < np.linalg.norm(target)
    # Nearer to the line of sight at the start too, and not what ends inside the foveas by mistake.
    assert abs(math.atan2(distractor[1], distractor[0])) < abs(math.atan2(target[1], target[0]))
    apart = math.acos(target @ distractor / np.linalg.norm(target) / np.linalg.norm(distractor))
    assert math.degrees(apart) > 10


def test_metric_ii_sees_every_cube():
    assert {station.name for station in stations(0.065) if not station.has_boxes} == {"paper_marker"}


def test_the_held_station_lies_on_the_left_axis():
    station = cube_held(0.065)
    assert station.place_m is not None
    x, y, z = station.place_m
    assert math.degrees(math.atan2(y - 0.0325, x)) == pytest.approx(station.start_version_deg)
    assert z == 0.0
    assert (station.mode, station.start_vergence_deg) == ("left_held", 0.0)


def test_the_marker_station_is_the_papers_80_degrees():
    station = marker_80_80()
    assert station.start_vergence_deg == pytest.approx(180 - 2 * 80)
    assert station.place_m is None


def test_the_report_opens_with_one_picture_of_every_station(result, tmp_path):
    other = dataclasses.replace(result, name="other", reported_verged=False)
    for part, suffix in (("end_left", "jpg"), ("start_combined", "png"), ("end_combined", "png")):
        (tmp_path / "pictures").mkdir(exist_ok=True)
        cv2.imwrite(str(tmp_path / "pictures" / f"cube_{part}.{suffix}"), np.full((240, 320, 3), 90, np.uint8))
    write_report(tmp_path / "report.html", [result, other], SETTINGS, tmp_path)
    picture = read_image(tmp_path / "pictures" / "overview.png")
    left, right = np.hsplit(picture, 2)
    assert (left[30:190, :180] == 90).all()
    assert (right[30:] == 255).all()  # the other station has no pictures
    assert (right[:20] != 255).any()  # but a verdict
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert page.index("<img") < page.index("<table")


def test_without_pictures_the_report_has_no_overview(result, tmp_path):
    write_report(tmp_path / "report.html", [result], SETTINGS, tmp_path)
    assert not (tmp_path / "pictures").exists()
    assert "<img" not in (tmp_path / "report.html").read_text(encoding="utf-8")
