"""Sightings that one patch of each thing brings into line."""

import cv2
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from vergence_calibration.geometry.refinement import refined
from vergence_calibration.geometry.views import Observations

WIDTH, HEIGHT = 320, 240
PLACES = np.array([(60.0 + 50 * i, 60.0 + 40 * j) for i in range(5) for j in range(4)])


def textured(seed: int) -> np.ndarray:
    random = np.random.default_rng(seed)
    rough = random.normal(0.0, 1.0, (HEIGHT, WIDTH)).astype(np.float32)
    smooth = cv2.GaussianBlur(rough, (0, 0), 2.0)
    return np.asarray(np.clip(128 + 40 * smooth / smooth.std(), 0, 255), np.uint8)


def seen_in(views: list[np.ndarray], wrong_px: float, seed: int) -> Observations:
    """Return sightings of PLACES, each off by some pixels but in the first view, of which `views` are maps (2, 3)."""
    random = np.random.default_rng(seed)
    true = np.vstack([PLACES @ view[:, :2].T + view[:, 2] for view in views])
    view = np.repeat(np.arange(len(views)), len(PLACES))
    found = true + random.uniform(-wrong_px, wrong_px, true.shape)
    found[: len(PLACES)] = PLACES
    return Observations(view, np.tile(np.arange(len(PLACES)), len(views)), found)


def pictures_of(picture: np.ndarray, views: list[np.ndarray], noise: float) -> list[np.ndarray]:
    random = np.random.default_rng(7)
    drawn = [cv2.warpAffine(picture, view, (WIDTH, HEIGHT), flags=cv2.INTER_CUBIC) for view in views]
    return [np.asarray(np.clip(one + random.normal(0, noise, one.shape), 0, 255).astype(np.uint8)) for one in drawn]


@given(
    turn=st.floats(-0.1, 0.1),
    scale=st.floats(0.85, 1.15),
    shift=st.tuples(st.floats(-15, 15), st.floats(-15, 15)),
    seed=st.integers(0, 50),
)
@settings(max_examples=25, deadline=None)
def test_patches_are_laid_on_each_other_to_a_small_part_of_a_pixel(
    turn: float, scale: float, shift: tuple[float, float], seed: int
) -> None:
    still = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    middle = np.array([160.0, 120.0])
    linear = scale * np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    turned = np.column_stack([linear, middle - linear @ middle + shift])
    views = [still, turned, turned]
    seen = seen_in(views, 0.6, seed)
    by_direction = np.repeat([view[:, :2] for view in views], len(PLACES), axis=0)
    found = refined(pictures_of(textured(seed), views, 2.0), seen, by_direction)
    assert len(found.view) > 0.6 * len(seen.view)
    # Whichever view a thing is compared with: its sightings agree with one another, back in the first view.
    back = np.empty_like(found.pixels)
    for number, view in enumerate(views):
        mine = found.view == number
        back[mine] = (found.pixels[mine] - view[:, 2]) @ np.linalg.inv(view[:, :2]).T
    for thing in np.unique(found.point):
        spread = back[found.point == thing]
        assert np.abs(spread - spread.mean(axis=0)).max() < 0.1


def test_a_patch_that_fits_nowhere_is_left_out() -> None:
    still = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    views = [still] * 4
    seen = seen_in(views, 0.0, 0)
    pictures = pictures_of(textured(1), views, 2.0)
    pictures[3] = textured(2)
    found = refined(pictures, seen, np.tile(np.eye(2), (len(seen.view), 1, 1)))
    assert set(found.view.tolist()) == {0, 1, 2}
    assert len(np.unique(found.point)) == found.point.max() + 1


def test_what_too_few_views_show_alike_is_left_out() -> None:
    still = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    views = [still] * 3
    seen = seen_in(views, 0.0, 0)
    pictures = pictures_of(textured(1), views, 2.0)
    pictures[2] = textured(2)
    assert len(refined(pictures, seen, np.tile(np.eye(2), (len(seen.view), 1, 1))).view) == 0


def test_edges_and_things_behind_the_camera_are_left_out() -> None:
    still = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    views = [still] * 3
    seen = seen_in(views, 0.0, 0)
    edge = np.zeros((HEIGHT, WIDTH), np.uint8)
    edge[:, 60:] = 200
    alone = seen.kept(seen.point == 0)
    assert len(refined(pictures_of(edge, views, 1.0), alone, np.tile(np.eye(2), (3, 1, 1))).view) == 0
    behind = np.tile(np.eye(2), (len(seen.view), 1, 1))
    behind[seen.point == 3] = np.nan
    found = refined(pictures_of(textured(1), views, 1.0), seen, behind)
    assert len(np.unique(found.point)) == len(PLACES) - 1
