"""The controller reads the same of a track by way of the messages as `vergence.Head` hands over directly."""

from dataclasses import astuple

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from std_msgs.msg import Header

from vergence.body import Pixels
from vergence.pair_metric import track_sighting
from vergence.testing.wall_body import WallBody
from vergence_common.stamps import to_stamp
from vergence_gaze.ros import gaze_messages
from vergence_metric.disparity.angular_disparity import angular_disparity
from vergence_metric.measurement.edge_metric import EdgeMetric, EdgeMetricResult
from vergence_metric.ros.track_messages import track_message
from vergence_metric.tracking.track import Track, TrackStatus
from vergence_rig.camera import CameraModel
from vergence_rig.eye_image import eye_images
from vergence_rig.rig import default_rig

STAMP_S, SKEW_S = 12.25, 0.004


@pytest.fixture(scope="module")
def edge() -> EdgeMetricResult:
    view: Pixels = WallBody().view(0)
    return EdgeMetric().measure(view, view)


@settings(deadline=None)
@given(
    status=st.sampled_from([one for one in TrackStatus if one is not TrackStatus.UNUSABLE_IMAGES]),
    x=st.floats(0, 639),
    y=st.floats(0, 479),
    disparity_px=st.floats(-60, 60),
    extent_px=st.floats(4, 200),
    candidates=st.lists(st.tuples(st.floats(-60, 60), st.floats(0, 1)), max_size=3),
)
def test_both_ways_give_one_sighting(
    edge: EdgeMetricResult,
    status: TrackStatus,
    x: float,
    y: float,
    disparity_px: float,
    extent_px: float,
    candidates: list[tuple[float, float]],
) -> None:
    rig = default_rig()
    images = eye_images(rig, (CameraModel(rig.left_camera), CameraModel(rig.right_camera)))
    models = images[0].ideal, images[1].ideal
    track = Track(
        3,
        11.5,
        (x, y),
        (x - disparity_px, y),
        disparity_px,
        0.25,
        0.4,
        (extent_px, extent_px),
        0.9,
        status,
        "why",
        7,
        tuple(candidates),
    )
    angular = angular_disparity(*models, track.left_px, track.disparity_px, track.vertical_px)
    message = track_message(track, edge, angular, images, Header(stamp=to_stamp(STAMP_S)), SKEW_S)
    by_message = gaze_messages.track_sighting(message, images[0])
    directly = track_sighting(track, models, STAMP_S, SKEW_S)
    for one, other in zip(astuple(by_message), astuple(directly), strict=True):
        if isinstance(one, float):
            assert other == pytest.approx(one, abs=1e-6, nan_ok=True)
        elif isinstance(one, tuple):
            pairs = zip(one, other, strict=True)
            assert all(b == pytest.approx(a, abs=1e-6, nan_ok=True) for a, b in pairs)
        else:
            assert one == other
