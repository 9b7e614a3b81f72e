import math
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest

from vergence_metric.measurement.edge_metric import EdgeMetricResult
from vergence_metric.measurement.pair_measurement import PairMeasurement
from vergence_metric.measurement.parameters import PairMeasurementParameters
from vergence_metric.tracking.request import TrackRequest
from vergence_metric.tracking.track import Track, TrackStatus
from vergence_rig.geometry import EyeAngles
from vergence_rig.rig import default_rig

AT_REST = EyeAngles(0.0, 0.0, 0.0)


def view(shift_px: int, height: int = 480, width: int = 640) -> np.ndarray:
    random = np.random.default_rng(5)
    wide = cv2.GaussianBlur(random.integers(0, 256, (height, width + 40, 3), np.uint8), (0, 0), 3.0)
    wide = cv2.normalize(wide, None, 0, 255, cv2.NORM_MINMAX)
    return np.ascontiguousarray(wide[:, shift_px : shift_px + width])


@pytest.fixture
def measurement() -> PairMeasurement:
    return PairMeasurement(PairMeasurementParameters(), default_rig())


@pytest.fixture(scope="module")
def pair() -> EdgeMetricResult:
    return PairMeasurement(PairMeasurementParameters(), default_rig()).edge(view(0), view(0))


def locked(measurement: PairMeasurement, pair: EdgeMetricResult, start_s: float) -> Track:
    """Show the pair until the tracker has locked on the fovea."""
    for i in range(40):
        track = measurement.track(pair, start_s + i / 30, AT_REST, None)
        if track.status is TrackStatus.OK:
            return track
    raise AssertionError(track)


def change(measurement: PairMeasurement, group: str, **changes: Any) -> None:
    before = measurement.parameters
    measurement.set_parameters(replace(before, **{group: getattr(before, group).replaced(**changes)}))


def test_one_pair_gives_metric_disparity_and_verdict(measurement: PairMeasurement) -> None:
    edge = measurement.edge(view(0), view(9))
    disparity = measurement.disparity(edge)
    assert disparity.horizontal_px == pytest.approx(9.0, abs=0.05)
    assert not measurement.verged(edge, disparity.horizontal_px, disparity.confidence)
    edge = measurement.edge(view(0), view(0))
    disparity = measurement.disparity(edge)
    assert edge.left_to_right_px.max() == 0.0
    assert measurement.verged(edge, disparity.horizontal_px, disparity.confidence)


def test_a_change_elsewhere_leaves_the_target_and_one_of_the_tracker_gives_a_new_id(
    measurement: PairMeasurement, pair: EdgeMetricResult
) -> None:
    first = locked(measurement, pair, 0.0)
    change(measurement, "edges", windows_px=(60,))
    assert measurement.edge(view(0), view(0)).windows_px.tolist() == [60]
    assert measurement.track(pair, 10.0, AT_REST, None).track_id == first.track_id
    change(measurement, "tracker", settle_s=0.05)
    second = locked(measurement, pair, 20.0)
    assert second.track_id == first.track_id + 1
    change(measurement, "disparity", estimator="zncc")
    assert measurement.disparity(pair).estimator == "zncc"
    assert locked(measurement, pair, 30.0).track_id == second.track_id + 1


def test_without_joints_or_a_fitting_camera_there_is_no_track_but_a_reason(
    measurement: PairMeasurement, pair: EdgeMetricResult
) -> None:
    track = measurement.track(pair, 0.0, None, None)
    assert (track.status, track.reason) == (TrackStatus.UNLOCKED, "no joint_states at the image's stamp")
    assert math.isnan(track.disparity_px)
    small = measurement.edge(view(0, 120, 160), view(0, 120, 160))
    track = measurement.track(small, 0.0, AT_REST, None)
    assert (track.status, track.reason) == (TrackStatus.UNLOCKED, "no calibration for 160x120 images")


def test_a_request_for_motion_waits_until_something_moves(measurement: PairMeasurement) -> None:
    scene = view(0)
    locked(measurement, measurement.edge(scene, scene), 1.0)
    measurement.request_track(TrackRequest(8, 0.0, True, (math.nan, math.nan), motion=True))
    tracks = []
    for k in range(12):
        shown = scene.copy()
        x = 200 + 9 * max(k - 4, 0)
        shown[200:290, x : x + 90] = scene[20:110, 300:390]
        tracks.append(measurement.track(measurement.edge(shown, shown), 3.0 + k / 30, AT_REST, None))
    assert {track.goal_id for track in tracks} == {8}
    assert all(track.status is TrackStatus.LOST for track in tracks[:4])
    assert all("waiting for something that moves" in track.reason for track in tracks[:4])
    assert tracks[-1].status in (TrackStatus.OK, TrackStatus.AMBIGUOUS), tracks[-1].reason
    assert tracks[-1].left_px == pytest.approx((200 + 9 * 7 + 45, 245), abs=20.0)


def test_thresholds_of_verged_apply_from_the_next_pair_on(measurement: PairMeasurement, pair: EdgeMetricResult) -> None:
    assert measurement.verged(pair, 1.5, 0.9)
    change(measurement, "verged", enter_rad=0.001)
    assert not measurement.verged(pair, 1.5, 0.9)


@pytest.mark.parametrize("pixel", [(640.0, 100.0), (-0.5, 100.0), (100.0, 479.5), (math.nan, 100.0)])
def test_a_requested_point_outside_the_image_is_named_and_the_target_stays(
    measurement: PairMeasurement, pair: EdgeMetricResult, pixel: tuple[float, float]
) -> None:
    before = locked(measurement, pair, 0.0)
    measurement.request_track(TrackRequest(8, 0.0, True, pixel))
    after = measurement.track(pair, 2.0, AT_REST, None)
    assert (after.track_id, after.goal_id) == (before.track_id, before.goal_id)
    assert "the point of goal 8" in measurement.unmet_request
    assert "must be in the 640x480 image" in measurement.unmet_request


def test_a_point_of_the_right_image_that_the_left_eye_does_not_see_is_named(measurement: PairMeasurement) -> None:
    other = np.random.default_rng(6).integers(0, 256, (480, 640, 3), np.uint8)
    converging = EyeAngles(0.0, 0.2, 0.0)
    shown = measurement.edge(view(0), other)
    measurement.track(shown, 1.0, converging, None)
    measurement.request_track(TrackRequest(8, 1.0, False, (5.0, 240.0)))
    track = measurement.track(shown, 1.0 + 1.0 / 30.0, converging, None)
    assert track.goal_id == 0
    assert "the point of goal 8: the left eye does not see it" in measurement.unmet_request
    measurement.request_track(TrackRequest(9, 1.0, False, (500.0, 240.0)))
    assert measurement.track(shown, 1.0 + 2.0 / 30.0, converging, None).goal_id == 9
    assert not measurement.unmet_request
