"""The goal of `vergence look` from its options, and the lines that it prints."""

import argparse
import math

import pytest

from vergence_bringup.commands.look_request import add_arguments, feedback_line, look_request, result_line


def request(*words):
    parser = argparse.ArgumentParser()
    add_arguments(parser)
    return look_request(parser.parse_args(words))


@pytest.mark.parametrize(
    ("words", "kind", "fields"),
    [
        (("--pixel", "412", "230"), "PIXEL", {"eye": 0, "left_x_px": 412.0, "left_y_px": 230.0}),
        (("--pixel", "4", "-2.5", "--eye", "right"), "PIXEL", {"eye": 1, "right_x_px": 4.0, "right_y_px": -2.5}),
        (("--pixel", "4", "2", "--depth", "0.5"), "PIXEL", {"depth_m": 0.5}),
        (("--stereo", "1", "2", "3", "4"), "STEREO_PIXEL", {"left_x_px": 1.0, "right_x_px": 3.0, "right_y_px": 4.0}),
        (("--class", "cube"), "CLASS", {"class_name": "cube"}),
        (("--angles", "0", "10", "-5"), "ANGLES", {"vergence_rad": math.radians(10), "tilt_rad": math.radians(-5)}),
        (("--motion",), "MOTION", {}),
        (("--turn", "3", "0", "0"), "RELATIVE_ANGLES", {"version_rad": math.radians(3)}),
    ],
)
def test_every_kind_of_goal(words, kind, fields):
    made = request(*words)
    assert made.kind == kind
    assert {name: made.fields[name] for name in fields} == fields


def test_a_pixel_without_a_depth_has_none():
    assert math.isnan(float(request("--pixel", "1", "2").fields["depth_m"]))


def test_a_point_in_a_frame():
    made = request("--point", "0.6", "0.1", "-0.2", "--frame", "left_camera_optical_frame")
    assert (made.kind, made.point_m, made.frame) == ("POINT", (0.6, 0.1, -0.2), "left_camera_optical_frame")
    assert "left_camera_optical_frame" in made.text
    assert request("--point", "1", "0", "0").frame == "rig_base"


@pytest.mark.parametrize(
    "words",
    [
        (),
        ("--pixel", "1"),
        ("--pixel", "1", "nan"),
        ("--pixel", "1", "2", "--class", "cube"),
        ("--motion", "--class", "cube"),
        ("--point", "1", "2", "inf"),
        ("--pixel", "1", "2", "--eye", "middle"),
        ("--pixel", "1", "2", "--depth", "-1"),
    ],
)
def test_what_is_no_goal_ends_with_the_usage(words, capsys):
    with pytest.raises(SystemExit, match="2"):
        request(*words)
    assert "error:" in capsys.readouterr().err


@pytest.mark.parametrize("words", [("--class", ""), ("--class", "cube", "--depth", "1")])
def test_options_that_do_not_fit_together_are_named(words):
    with pytest.raises(ValueError, match="--"):
        request(*words)


def test_the_lines_show_figures_and_a_dash_for_what_is_not_known():
    line = feedback_line("verge", (0.123, -1.5, math.nan), math.nan)
    assert line == "verge    to turn: version +0.12, vergence -1.50, tilt - deg; contrast -"
    line = result_line("VERGED", 0.83, "", (0.6, 0.05, 0.0), "", math.radians(6))
    assert line == "VERGED after 0.83 s\nthe eyes look at (0.600, 0.050, 0.000) m in rig_base, vergence 6.00 deg"
    assert result_line("VERGED", 0.83, "", (0.6, 0.05, 0.0), "", 0.1, "0.60 m (0.50 to inf m)").endswith(
        " deg\nthe target's distance, with its interval of 95 %: 0.60 m (0.50 to inf m)"
    )
    assert result_line("LOST", 2.0, "no track", (math.nan,) * 3, "", math.nan) == "LOST after 2.00 s: no track"
