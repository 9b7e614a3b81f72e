"""The geometry benchmark: its heads, what the graph is given of them, and its figures."""

import math
from dataclasses import replace

import numpy as np
import pytest

from bench import bench_geometry
from bench.geometry_points import PointTrial, angles_deg
from bench.geometry_trials import (
    FOUND,
    HEADS,
    IDENTIFIED,
    PRINCIPAL_POINT,
    UNCALIBRATED,
    GeometryOutcome,
    GeometryTrial,
    head_of,
    rig_given,
    trials,
)
from vergence_rig.rig import default_rig
from vergence_rig.rig_file import write_rig
from vergence_rig.servo import SG90

TRIAL = GeometryTrial(IDENTIFIED, False, 0, 0)
VERGED = GeometryOutcome(TRIAL, 0.5, True, True, False, 0.1, 0.05, (0.505, 0.49, 0.52), "verged")


def test_every_head_has_its_share_of_the_clicks():
    heads = [trial.head for trial in trials(IDENTIFIED, 40)]
    assert [heads.count(head) for head in range(HEADS)] == [4] * HEADS


def test_the_arms_give_what_they_say(monkeypatch, tmp_path):
    head = head_of(TRIAL)
    assert rig_given(TRIAL, head) == head.with_servos(SG90)
    undescribed = rig_given(replace(TRIAL, arm=UNCALIBRATED), head)
    assert undescribed.left_mount == default_rig().left_mount
    assert undescribed.zero_sigma_rad > 0
    found = replace(head, baseline_m=0.0651)
    write_rig(tmp_path / "head_0.yaml", found)
    monkeypatch.setattr("bench.geometry_heads.FOLDER", tmp_path)
    assert rig_given(replace(TRIAL, arm=FOUND), head) == found


def test_principal_points_are_far_off_and_each_eyes_own():
    heads = [head_of(GeometryTrial(PRINCIPAL_POINT, False, head, 0)) for head in range(HEADS)]
    off = [(c.cx_px - 319.5, c.cy_px - 239.5) for head in heads for c in (head.left_camera, head.right_camera)]
    assert 40 < np.abs(off).max() <= 60
    assert len(set(off)) == 2 * HEADS


def test_joints_alone_bring_described_heads_to_a_point():
    angles = angles_deg(PointTrial(0))
    assert max(angles) < 0.1
    # With the default's description the same head misses by degrees.
    assert np.median(angles_deg(PointTrial(0, default_rig()))) > 1.0


def test_rows_are_of_the_clicks_that_ended_verged():
    never = replace(VERGED, verged=False, ever_verged=False, aside_deg=9.0, stated_m=(math.nan,) * 3)
    far_off = replace(VERGED, aside_deg=0.3, stated_m=(0.6, 0.55, 0.65))
    rows = {row.what: row.value for row in bench_geometry.identified_rows([VERGED, never, far_off], "")}
    assert rows["geometry.aside_deg.identified"] == pytest.approx(0.2)
    assert rows["geometry.distance_error.identified"] == pytest.approx(0.5 * (0.01 + 0.2))
    assert rows["geometry.distance_interval.identified"] == 0.5
    assert rows["geometry.verged.identified"] == pytest.approx(2 / 3)


def test_a_click_that_failed_is_named():
    lines = bench_geometry.failures([VERGED, replace(VERGED, falsely_verged=True), replace(VERGED, seen_deg=1.0)])
    assert len(lines) == 3
    assert "FALSELY" in lines[1]
