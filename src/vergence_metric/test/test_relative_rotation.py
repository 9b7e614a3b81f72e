"""The visual encoder on features of a synthetic room: exact without noise, honest with it, robust to wrong matches."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vergence_metric.eye_rotation.relative_rotation import MIN_MATCHES, EncoderError, RigPrior, relative_rotation
from vergence_rig.geometry import rotation_rig_from_eye

BASELINE_M, FOCAL_PX = 0.065, 539.0


def room(
    pans_rad: tuple[float, float],
    count: int,
    seed: int,
    noise_px: float = 0.0,
    wrong_share: float = 0.0,
    roll_rad: float = 0.0,
    pitch_rad: float = 0.0,
    left_roll_rad: float = 0.0,
) -> tuple[np.ndarray, np.ndarray]:
    """Features that both eyes see at these true pans: normalised coordinates (N, 2), (N, 2)."""
    random = np.random.default_rng(seed)
    ahead = random.uniform(0.6, 4.0, 20 * count)
    points = np.column_stack(
        [ahead, ahead * random.uniform(-1, 1, ahead.size), ahead * random.uniform(-0.6, 0.6, ahead.size)]
    )
    views = []
    for left, pan in ((True, pans_rad[0]), (False, pans_rad[1])):
        pitch = rotation_rig_from_eye(0.0, 0.0 if left else pitch_rad)
        roll = left_roll_rad if left else roll_rad
        sine, cosine = math.sin(roll), math.cos(roll)
        turn = rotation_rig_from_eye(pan, 0.0) @ pitch @ np.array([[1, 0, 0], [0, cosine, -sine], [0, sine, cosine]])
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


EXACT_CAMERAS = RigPrior(focal=0.0, distortion=0.0)


@pytest.mark.parametrize(("version", "vergence"), [(0.0, 0.1), (0.3, 0.05), (-0.4, 0.2)])
@pytest.mark.parametrize("offset_deg", [-0.8, 0.5])
def test_without_noise_the_rotation_is_found(version: float, vergence: float, offset_deg: float) -> None:
    true = (version - 0.5 * vergence, version + 0.5 * vergence)
    left, right = room(true, 200, 1, roll_rad=0.006, pitch_rad=0.009, left_roll_rad=-0.003)
    found = relative_rotation(left, right, true[0], true[1] + math.radians(offset_deg), EXACT_CAMERAS)
    assert math.degrees(found.vergence_rad - vergence) == pytest.approx(0.0, abs=2e-3)
    assert found.corrections_rad == pytest.approx([math.radians(-offset_deg), 0.006, 0.009, 0.0, -0.003], abs=2e-4)


@settings(deadline=None, max_examples=40)
@given(
    version=st.floats(-0.5, 0.5),
    vergence=st.floats(0.02, 0.22),
    said=st.tuples(st.floats(-0.01, 0.01), st.floats(-0.01, 0.01)),
    mounts=st.tuples(*[st.floats(-0.02, 0.02)] * 3),
    seed=st.integers(0, 1000),
)
def test_any_pans_inside_the_play_are_found_within_five_stated_deviations(
    version: float, vergence: float, said: tuple[float, float], mounts: tuple[float, float, float], seed: int
) -> None:
    true = (version - 0.5 * vergence, version + 0.5 * vergence)
    left, right = room(true, 250, seed, 0.3, 0.15, *mounts)
    found = relative_rotation(left, right, true[0] + said[0], true[1] + said[1])
    assert abs(found.vergence_rad - vergence) < 5.0 * found.sigma_rad < math.radians(0.75)
    # The eye's own axis against the bar is determined by depth alone, so to a degree or so; no worse than its prior.
    assert found.covariance_rad2.shape == (5, 5)
    assert np.linalg.eigvalsh(found.covariance_rad2).min() > 0


@pytest.mark.parametrize("calibrated", [True, False])
def test_stated_deviation_holds_with_noise_wrong_matches_and_an_uncertain_calibration(calibrated: bool) -> None:
    prior = RigPrior(focal=0.001, distortion=0.002)
    scores = []
    for seed in range(100):
        random = np.random.default_rng([3, seed])
        version, vergence = random.uniform(-0.4, 0.4), random.uniform(0.03, 0.2)
        true = (version - 0.5 * vergence, version + 0.5 * vergence)
        views = room(true, 250, seed, 0.3, 0.15, 0.006, 0.009, -0.003)
        if not calibrated:
            views = tuple(
                view * (1.0 + random.normal(0, 0.001) + random.normal(0, 0.002) * (view**2).sum(1, keepdims=True))
                for view in views
            )
        said = true + random.normal(0.0, math.radians(0.3), 2)
        found = relative_rotation(*views, float(said[0]), float(said[1]), prior)
        scores.append((found.vergence_rad - vergence) / found.sigma_rad)
        assert found.sigma_rad < math.radians(0.15)
    assert 0.6 < np.std(scores) < 1.2
    assert np.mean(np.abs(scores) < 1.96) > 0.9


def test_image_centres_beyond_the_pans_zero_add_uncertainty() -> None:
    left, right = room((-0.05, 0.05), 250, 1, noise_px=0.3)
    sure = relative_rotation(left, right, -0.05, 0.05).sigma_rad
    unsure = relative_rotation(left, right, -0.05, 0.05, RigPrior(centre_rad=0.001)).sigma_rad
    assert unsure == pytest.approx(math.hypot(sure, math.sqrt(2.0) * 0.001))


def test_few_or_unpaired_matches_are_refused() -> None:
    left, right = room((-0.05, 0.05), MIN_MATCHES - 1, 1)
    with pytest.raises(EncoderError, match=str(MIN_MATCHES)):
        relative_rotation(left, right, -0.05, 0.05)
    with pytest.raises(EncoderError, match="both be"):
        relative_rotation(left, right[:-1], -0.05, 0.05)


def test_features_in_one_place_have_a_large_deviation() -> None:
    left, right = room((-0.05, 0.05), 3000, 1, noise_px=0.5)
    middle = np.abs(left).max(axis=1) < 0.08
    found = relative_rotation(left[middle], right[middle], -0.05, 0.05)
    assert found.sigma_rad > math.radians(0.2)
