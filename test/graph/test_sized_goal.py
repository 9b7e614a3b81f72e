"""The size of a goal's thing, from LookAt to the track request, in pixels of the image in which it was seen."""

import math

import numpy as np
import pytest

from vergence_gaze.goals.goal import TrackRequest
from vergence_gaze.ros import look_at_messages as convert
from vergence_gaze.ros.gaze_messages import track_request
from vergence_msgs.action import LookAt
from vergence_rig.camera import CameraModel
from vergence_rig.eye_image import eye_images
from vergence_rig.rig import default_rig

IMAGES = eye_images(default_rig(), (CameraModel(default_rig().left_camera), CameraModel(default_rig().right_camera)))
NOWHERE = (math.nan,) * 3


def goal(width_px: float, height_px: float, eye: int = LookAt.Goal.EYE_LEFT) -> LookAt.Goal:
    return LookAt.Goal(kind=LookAt.Goal.PIXEL, eye=eye, width_px=width_px, height_px=height_px)


@pytest.mark.parametrize("eye", [LookAt.Goal.EYE_LEFT, LookAt.Goal.EYE_RIGHT])
def test_the_size_of_a_goal_is_that_of_the_request(eye: int) -> None:
    extent_rad = convert.goal(goal(60.0, 40.0, eye), NOWHERE, *IMAGES).extent_rad
    asked = track_request(TrackRequest(1, 2.0, eye == 0, (0.0, 0.0), extent_rad), IMAGES)
    assert (asked.width_px, asked.height_px) == pytest.approx((60.0, 40.0))


@pytest.mark.parametrize("size_px", [(0.0, 0.0), (60.0, 0.0), (math.nan, math.nan)])
def test_a_goal_without_a_size_has_none(size_px: tuple[float, float]) -> None:
    assert np.isnan(convert.goal(goal(*size_px), NOWHERE, *IMAGES).extent_rad).all()


@pytest.mark.parametrize("size_px", [(-1.0, 5.0), (5.0, math.inf)])
def test_a_size_that_no_thing_has_is_refused(size_px: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match="width_px and height_px must be at least 0"):
        convert.goal(goal(*size_px), NOWHERE, *IMAGES)
