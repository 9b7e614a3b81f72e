"""The state for the page: figures of the messages, null for what is unknown or old."""

import json
import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from vergence_rig.camera import CameraModel
from vergence_rig.rig import CameraSpec, EyeMount, Rig, default_rig
from vergence_web.eye_marks import EyeMarks
from vergence_web.health import Health
from vergence_web.page_state import Newest, PageState, ellipse_95

NAN = math.nan


def joints(left: float, right: float, tilt: float = 0.0) -> Any:
    return SimpleNamespace(name=["tilt", "pan_left", "pan_right"], position=[tilt, left, right])


def gaze_state(**changes: Any) -> Any:
    names = (
        "version_rad vergence_rad tilt_rad version_residual_rad vergence_residual_rad tilt_residual_rad "
        "residual_px contrast distance_m distance_low_m distance_high_m miss_distance_m"
    )
    values = dict.fromkeys(names.split(), NAN) | {
        "phase_name": "idle",
        "reason": "no goal yet",
        "law": "predictive",
        "mode": "both_eyes",
        "verged": False,
        "target_moving": False,
        "target": SimpleNamespace(x=NAN, y=NAN, z=NAN),
        "target_covariance": [NAN] * 9,
    }
    return SimpleNamespace(**values | changes)


def state(age_s: float = 0.1, **messages: Any) -> dict[str, Any]:
    names = {"joints": "joint_states", "command": "joint_command", "gaze": "gaze/state"}
    built = PageState(default_rig()).build({names[name]: Newest(one, age_s) for name, one in messages.items()})
    json.dumps(built, allow_nan=False)
    return built


def test_a_silent_graph_is_all_null() -> None:
    assert set(state().values()) == {None}


def test_angles_are_by_joint_name() -> None:
    built = state(joints=joints(-0.1, 0.1, 0.2), command=joints(-0.2, 0.1))
    assert built["seen"] == {"version_rad": 0.0, "vergence_rad": 0.2, "tilt_rad": 0.2}
    assert built["wanted"] == {"version_rad": -0.05, "vergence_rad": 0.3, "tilt_rad": 0.0}


def test_a_missing_joint_is_no_angle() -> None:
    lone = SimpleNamespace(name=["pan_left"], position=[0.1])
    assert state(joints=lone)["seen"] is None
    assert state(joints=joints(NAN, 0.1))["seen"] is None


def test_what_is_old_is_null() -> None:
    assert state(age_s=5.0, joints=joints(0.0, 0.1), gaze=gaze_state())["gaze"] is None


def test_unknown_figures_are_null_and_infinity_is_a_word() -> None:
    built = state(gaze=gaze_state(distance_high_m=math.inf, contrast=0.5))["gaze"]
    assert built["vergence_rad"] is None
    assert built["contrast"] == 0.5
    assert built["distance_high_m"] == "infinite"


def test_texts_from_outside_are_shortened() -> None:
    assert len(state(gaze=gaze_state(reason="x" * 10_000))["gaze"]["reason"]) == 300


def test_the_metric_is_of_the_small_window_with_the_least_contrast() -> None:
    edge = SimpleNamespace(
        windows_px=[50, 100, 300],
        left_to_right_px=[1.0, NAN, 3.0],
        right_to_left_px=[1.5, 2.5, 3.5],
        contrast=[0.9, 0.4, 0.1],
        status=[0, 1, 0],
        verged=True,
    )
    built = PageState(default_rig()).build({"vergence/edge": Newest(edge, 0.1)})["edge"]
    assert built["best"] == 1
    assert built["left_to_right_px"] == [1.0, None, 3.0]


def test_a_metric_of_many_windows_is_bounded() -> None:
    many = [1.0] * 5000
    edge = SimpleNamespace(
        windows_px=[50] * 5000, left_to_right_px=many, right_to_left_px=many, contrast=many, status=many, verged=False
    )
    built = PageState(default_rig()).build({"vergence/edge": Newest(edge, 0.1)})["edge"]
    assert {len(values) for values in built.values() if isinstance(values, list)} == {20}


def detection(left: float) -> Any:
    return SimpleNamespace(class_name="cube", score=NAN, x_min_px=left, y_min_px=1.0, x_max_px=9.0, y_max_px=8.0)


def test_boxes_carry_the_stamp_of_their_image() -> None:
    stamp = SimpleNamespace(sec=1_795_825_253, nanosec=5)
    message = SimpleNamespace(header=SimpleNamespace(stamp=stamp), left=[detection(2.04)], right=[])
    built = PageState(default_rig()).build({"vergence/detections": Newest(message, 0.1)})["detections"]
    assert built == {
        "stamp": "1795825253000000005",
        "left": [{"class": "cube", "score": None, "xyxy": [2.0, 1.0, 9.0, 8.0]}],
        "right": [],
    }


def test_the_head_from_above_meets_where_the_axes_do() -> None:
    half = math.atan2(0.0325, 0.5)
    head = state(joints=joints(-half, half))["head"]
    assert head["lenses"] == [[0.0, 0.0325], [0.0, -0.0325]]
    assert head["fixation"] == pytest.approx([0.5, 0.0], abs=1e-3)
    assert head["axes"][0] == pytest.approx([math.cos(half), -math.sin(half)], abs=1e-3)


def test_parallel_axes_have_no_fixation() -> None:
    assert state(joints=joints(0.0, 0.0))["head"]["fixation"] is None


def test_the_ellipse_holds_95_percent() -> None:
    turn = np.array([[math.cos(0.4), -math.sin(0.4)], [math.sin(0.4), math.cos(0.4)]])
    covariance = np.zeros((3, 3))
    covariance[:2, :2] = turn @ np.diag([0.09, 0.01]) @ turn.T
    found = ellipse_95(covariance)
    assert found is not None
    drawn = np.random.default_rng(0).multivariate_normal((0, 0), covariance[:2, :2], 20_000)
    angle = found["angle_rad"]
    along = drawn @ (math.cos(angle), math.sin(angle)) / found["long_m"]
    across = drawn @ (-math.sin(angle), math.cos(angle)) / found["short_m"]
    assert float(np.mean(along**2 + across**2 <= 1)) == pytest.approx(0.95, abs=0.01)


def test_an_unknown_covariance_has_no_ellipse() -> None:
    assert ellipse_95(np.full((3, 3), NAN)) is None
    assert state(joints=joints(0.0, 0.1), gaze=gaze_state())["head"]["ellipse"] is None


def test_marks_of_ideal_eyes_lie_about_the_middle() -> None:
    left, right = EyeMarks(default_rig()).marks([100])
    assert left == right
    assert left["size"] == [640, 480]
    assert left["fovea"] == [319.5, 239.5]
    assert left["windows"] == [[[269.5, 189.5], [369.5, 189.5], [369.5, 289.5], [269.5, 289.5]]]


def test_marks_follow_the_camera_and_its_mount() -> None:
    rig = Rig(left_mount=EyeMount(roll_rad=0.1))
    marks = EyeMarks(rig)
    marks.set_camera(False, CameraModel(CameraSpec(cx_px=300.0, cy_px=250.0)), 640, 480)
    left, right = marks.marks([100])
    assert right["fovea"] == [300.0, 250.0]
    assert left["fovea"] == [319.5, 239.5]
    (window,) = left["windows"]
    edge = np.subtract(window[1], window[0])
    assert abs(math.atan2(edge[1], edge[0])) == pytest.approx(0.1, abs=0.01)


def test_an_uncalibrated_camera_is_scaled_from_the_rig() -> None:
    marks = EyeMarks(default_rig())
    assert marks.marks([])[0]["fovea"] == [319.5, 239.5]
    for left in (True, False):
        marks.set_camera(left, None, 320, 240)
    assert marks.marks([])[0]["fovea"] == [159.5, 119.5]


def test_the_worst_diagnostic_comes_first_and_a_silent_one_is_stale() -> None:
    health = Health()
    health.add("a: fine", 0, "ok", {"n": "1"}, 10.0)
    health.add("b: broken", 2, "broken", {}, 10.0)
    health.add("c: gone", 0, "ok", {}, 2.0)
    listed = health.as_values(10.5)
    assert [(entry["name"], entry["level"]) for entry in listed] == [("c: gone", 3), ("b: broken", 2), ("a: fine", 0)]
    assert listed[0]["message"] == "silent for 8 s"
    assert listed[2]["values"] == {"n": "1"}


def test_diagnostics_from_outside_are_bounded() -> None:
    health = Health()
    for number in range(1000):
        health.add(f"n{number}", 0, "x" * 5000, {str(key): "v" for key in range(1000)}, 0.0)
    listed = health.as_values(0.0)
    assert len(listed) == 300
    assert all(len(entry["message"]) <= 300 and len(entry["values"]) <= 40 for entry in listed)
