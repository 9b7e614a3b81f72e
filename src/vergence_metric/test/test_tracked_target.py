"""A target's direction as lenses that lie off the axes move, and how often one without bounds is segmented."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vergence_metric.tracking.eye_view import EyeView, eye_views
from vergence_metric.tracking.target_appearance import TargetAppearance
from vergence_metric.tracking.tracked_target import Target, parallax
from vergence_rig.camera import CameraModel
from vergence_rig.geometry import EyeAngles
from vergence_rig.kinematics import Kinematics
from vergence_rig.rig import EyeMount, default_rig

CAMERA = CameraModel(default_rig().left_camera)
VIEW = EyeView(CAMERA, 0.0, 0.0)
LENS = {"lens_x_m": 0.022, "lens_y_m": 0.003, "lens_z_m": 0.002}
PRINTED = Kinematics(
    replace(default_rig(), left_mount=EyeMount(**LENS), right_mount=EyeMount(**LENS), tilt_axis_z_m=-0.045)
)


@given(
    before=st.tuples(*[st.floats(-0.2, 0.2)] * 3),
    turned=st.tuples(*[st.floats(-0.2, 0.2)] * 3),
    distance_m=st.floats(0.3, 2.0),
    aside=st.tuples(*[st.floats(-0.25, 0.25)] * 2),
)
def test_a_target_at_rest_is_predicted_from_where_the_lens_is_by_now(before, turned, distance_m, aside):
    then = eye_views(CAMERA, EyeAngles(*before), PRINTED)
    now = eye_views(CAMERA, EyeAngles(*np.add(before, turned)), PRINTED)
    point = distance_m * np.array([1.0, *aside])
    seen_then, seen_right, seen_now = (
        (point - view.lens_m) / np.linalg.norm(point - view.lens_m) for view in (*then, now[0])
    )
    target = a_target(seen_then, then)
    target.parallax_rad = parallax(then[0].pixel(seen_then), then, then[1].pixel(seen_right))
    if not math.isfinite(target.parallax_rad):
        return  # behind an eye
    target.turn_to(now)
    # The lenses of a printed head lie at different depths and heights, which the parallax leaves out.
    moved = math.acos(min(float(seen_then @ seen_now), 1.0))
    assert math.acos(min(float(target.direction @ seen_now), 1.0)) <= 0.15 * moved + 1e-3


def test_a_target_of_unknown_distance_keeps_its_direction():
    target = a_target(np.array([1.0, 0.0, 0.0]), eye_views(CAMERA, EyeAngles(0.0, 0.0, 0.0), PRINTED))
    target.turn_to(eye_views(CAMERA, EyeAngles(0.2, 0.2, 0.2), PRINTED))
    assert target.direction == pytest.approx([1.0, 0.0, 0.0])


def a_target(direction, views):
    image = np.zeros((60, 60), np.uint8)
    appearance = TargetAppearance(image, (30.0, 30.0), (20.0, 20.0))
    return Target(1, 0.0, appearance, 0.0, views, direction, np.zeros(3), False)


def test_a_target_without_bounds_is_segmented_ever_more_rarely() -> None:
    target = a_target(np.array([1.0, 0.0, 0.0]), (VIEW, VIEW))
    due = [pair for pair in range(1, 130) if target.segmentation_due()]
    assert due == [1, 2, 4, 8, 16, 32, 64, 96, 128]
