"""The demo's verdict, table, summary and report."""

import dataclasses
import json
import math

import cv2
import numpy as np
import pytest

from vergence_bringup.demo_report import write_report
from vergence_bringup.demo_result import MetricTable, Series, StationResult, summary, table, write_summary
from vergence_bringup.demo_stations import cube_held, marker_80_80, stations

SETTINGS = {"servo": "sg90", "cameras": "realistic", "duration_s": 1.0}


@pytest.fixture
def result():
    time_s = np.linspace(0, 1, 5)
    metric = MetricTable([50, 100], [1.0, math.nan], [2.0, 3.0], [0.3, 0.4])
    series = Series(time_s, time_s, time_s, time_s, time_s, time_s, time_s, time_s)
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
        series,
    )


@pytest.mark.parametrize(
    ("changes", "passed"),
    [
        ({}, True),
        ({"said_verged": False}, False),
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
    text = table([result, dataclasses.replace(result, said_verged=False, reason="lost")])
    assert "NOT VERGED" in text
    assert "lost" in text
    assert text.count("L to R") == 4
    assert "3.00" in text


def test_report_carries_its_pictures_and_plots(result, tmp_path):
    pictures = tmp_path / "pictures"
    pictures.mkdir()
    for moment in ("start", "end"):
        for kind in ("left.jpg", "right.jpg", "left_edges.png", "right_edges.png", "combined.png"):
            cv2.imwrite(str(pictures / f"cube_{moment}_{kind}"), np.zeros((8, 8, 3), np.uint8))
    write_report(tmp_path / "report.html", [result], SETTINGS, tmp_path)
    text = (tmp_path / "report.html").read_text()
    assert text.count("data:image/") == 10
    assert text.count("<svg") == 2
    assert text.count("<polyline") >= 5
    assert "http" not in text


def test_stations_are_what_the_paper_and_the_promise_say():
    every = stations(0.065)
    assert len({station.name for station in every}) == len(every) == 7
    free = [station for station in every if station.mode == "both_eyes"]
    assert sum(station.moving for station in free) == 1
    places = [station.place_m for station in free if station.place_m is not None]
    distances = [np.linalg.norm(place) for place in places]
    assert len(places) == 5
    assert min(distances) >= 0.3
    assert max(distances) <= 2.0
    assert any(place[2] > 0.1 for place in places)
    assert {station.name for station in stations(0.065, short=True)} < {station.name for station in every}


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
