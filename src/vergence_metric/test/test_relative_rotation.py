"""The visual encoder on features of a synthetic room: exact without noise, honest with it, robust to wrong matches."""

import math

import numpy as np
import pytest

from vergence_rig.geometry import rotation_rig_from_eye
from vergence_servo.gaze.visual_encoder import MINIMUM_MATCHES, EncoderError, relative_rotation

BASELINE_M, FOCAL_PX = 0.065, 539.0


def room(
    pans_rad: tuple[float, float],
    count: int,
    seed: int,
    noise_px: float = 0.0,
    wrong_share: float = 0.0,
    roll_rad: float = 0.0,
    pitch_rad: float = 0.0,
) -> tuple[np.ndarray, np.ndarray]:
    """Features that both eyes see at these true pans: normalised coordinates (N, 2), (N, 2)."""
    random = np.random.default_rng(seed)
    ahead = random.uniform(0.6, 4.0, 20 * count)
    points = np.column_stack(
        [ahead, ahead * random.uniform(-1, 1, ahead.size), ahead * random.uniform(-0.6, 0.6, ahead.size)]
    )
    views = []
    for left, pan in ((True, pans_rad[0]), (False, pans_rad[1])):
        turn = rotation_rig_from_eye(pan, 0.0)
        if not left:
            pitch = rotation_rig_from_eye(0.0, pitch_rad)
            sine, cosine = math.sin(roll_rad), math.cos(roll_rad)
            turn = turn @ pitch @ np.array([[1, 0, 0], [0, cosine, -sine], [0, sine, cosine]])
        local = (points - (0.0, 0.5 * BASELINE_M if left else -0.5 * BASELINE_M, 0.0)) @ turn
        with np.errstate(all="ignore"):
            views.append(np.where(local[:, :1] > 0, -local[:, 1:] / local[:, :1], np.nan))
    seen = np.all([(np.abs(view) < (319 / FOCAL_PX, 239 / FOCAL_PX)).all(axis=1) for view in views], axis=0)
    left_xy, right_xy = (view[seen][:count] for view in views)
    left_xy = left_xy + random.normal(0.0, noise_px / FOCAL_PX, left_xy.shape)
    right_xy = right_xy + random.normal(0.0, noise_px / FOCAL_PX, right_xy.shape)
    wrong = random.random(len(right_xy)) < wrong_share
    right_xy[wrong] = random.uniform(-0.4, 0.4, (int(wrong.sum()), 2))
    return left_xy, right_xy


@pytest.mark.parametrize(("version", "vergence"), [(0.0, 0.1), (0.3, 0.05), (-0.4, 0.2)])
@pytest.mark.parametrize("offset_deg", [-0.8, 0.5])
def test_without_noise_the_rotation_is_found(version: float, vergence: float, offset_deg: float) -> None:
    true = (version - 0.5 * vergence, version + 0.5 * vergence)
    left, right = room(true, 200, 1, roll_rad=0.006, pitch_rad=0.009)
    found = relative_rotation(left, right, true[0], true[1] + math.radians(offset_deg))
    assert math.degrees(found.vergence_rad - vergence) == pytest.approx(0.0, abs=2e-3)
    assert found.roll_rad == pytest.approx(0.006, abs=1e-4)
    assert found.pitch_rad == pytest.approx(0.009, abs=1e-4)


def test_stated_deviation_holds_with_noise_and_wrong_matches() -> None:
    scores = []
    for seed in range(60):
        random = np.random.default_rng([3, seed])
        version, vergence = random.uniform(-0.4, 0.4), random.uniform(0.03, 0.2)
        true = (version - 0.5 * vergence, version + 0.5 * vergence)
        left, right = room(true, 250, seed, noise_px=0.5, wrong_share=0.15)
        said = true + random.normal(0.0, math.radians(0.3), 2)
        found = relative_rotation(left, right, float(said[0]), float(said[1]))
        scores.append((found.vergence_rad - vergence) / found.sigma_rad)
        assert found.sigma_rad < math.radians(0.2)
    assert 0.7 < np.std(scores) < 1.5
    assert np.mean(np.abs(scores) < 2.0) > 0.85


def test_few_or_unpaired_matches_are_refused() -> None:
    left, right = room((-0.05, 0.05), MINIMUM_MATCHES - 1, 1)
    with pytest.raises(EncoderError, match=str(MINIMUM_MATCHES)):
        relative_rotation(left, right, -0.05, 0.05)
    with pytest.raises(EncoderError, match="twice"):
        relative_rotation(left, right[:-1], -0.05, 0.05)


def test_features_in_a_heap_are_not_better_than_joints() -> None:
    left, right = room((-0.05, 0.05), 3000, 1, noise_px=0.5)
    middle = np.abs(left).max(axis=1) < 0.08
    found = relative_rotation(left[middle], right[middle], -0.05, 0.05)
    assert not found.is_better_than(math.radians(0.1))
