"""How far away the surroundings of a point are, and that a lens which has moved expects them there."""

import cv2
import numpy as np
import pytest

from vergence_metric.tracking.eye_view import EyeView
from vergence_metric.tracking.remembered_patch import RememberedPatch
from vergence_metric.tracking.request import StoredPair
from vergence_metric.tracking.requested_target import surroundings_m
from vergence_metric.tracking.surroundings import surroundings_disparity
from vergence_rig.camera import CameraModel
from vergence_rig.rig import default_rig

CAMERA = CameraModel(default_rig().left_camera)
AT = (320.0, 240.0)
WALL_PX, WALL_M = 21, 2.0
BASELINE_M = WALL_PX * WALL_M / CAMERA.fx_px


def texture(seed, sigma):
    image = np.random.default_rng(seed).normal(0.0, 1.0, (520, 1000)).astype(np.float32)
    image = cv2.GaussianBlur(image, (0, 0), sigma)
    return np.clip(120.0 + 40.0 * image / image.std(), 0, 255).astype(np.uint8)


WALL, STICK = texture(1, 3.0), texture(2, 2.0)


def seen(wall_px, stick_px, down_px=0):
    """A wall and an upright stick before it, both so far to the left."""
    image = WALL[20 + down_px : 500 + down_px, 100 + wall_px : 740 + wall_px].copy()
    first = round(AT[0]) - 6 - stick_px
    image[:, first : first + 12] = STICK[20:500, :12]
    return image


@pytest.mark.parametrize("at", [AT, (60.0, 70.0), (600.0, 460.0)])
def test_most_of_what_surrounds_a_thin_thing_is_what_is_behind_it(at):
    assert surroundings_disparity(seen(0, 0), seen(WALL_PX, 80), at) == pytest.approx(WALL_PX, abs=2.0)


def test_views_that_are_unlike_each_other_have_no_disparity():
    assert surroundings_disparity(seen(0, 0), texture(9, 3.0)[:480, :640], AT) is None


def test_the_distance_is_by_the_parallax():
    views = tuple(EyeView(CAMERA, 0.0, 0.0, lens_m=(0.0, y, 0.0)) for y in (BASELINE_M / 2, -BASELINE_M / 2))
    pair = StoredPair(0.0, seen(0, 0), seen(WALL_PX, 80), (views[0], views[1]))
    assert surroundings_m(pair, AT) == pytest.approx(WALL_M, rel=0.1)
    assert surroundings_m(StoredPair(0.0, seen(0, 0), texture(9, 3.0)[:480, :640], pair.views), AT) is None


@pytest.mark.parametrize(("surroundings_m", "right"), [(WALL_M, True), (np.inf, False)])
def test_along_a_thin_thing_the_place_is_where_geometry_puts_it_beside_its_surroundings(surroundings_m, right):
    """The lens rises by 20 mm: a stick at 0.4 m looks the same all along, the wall sinks by a fifth of what it does."""
    stick_m, rise_m = 0.4, 0.02
    stick = np.repeat(STICK[240:241, :12], 480, axis=0)

    def with_stick(wall):
        wall[:, 314:326] = stick
        return wall

    before = EyeView(CAMERA, 0.0, 0.0)
    after = EyeView(CAMERA, 0.0, 0.0, lens_m=(0.0, 0.0, rise_m))
    down_px = round(CAMERA.fx_px * rise_m / WALL_M)
    patch = RememberedPatch(with_stick(seen(0, 0)), before, AT, surroundings_m)
    direction = after.direction_of(patch.direction, before, stick_m)
    now = with_stick(WALL[20 - down_px : 500 - down_px, 100:740].copy())
    # The joints are said to have turned by 5 px more than they have.
    expected = after.pixel(direction)
    found = patch.find(now, after, after.direction((expected[0], expected[1] + 5.0)), 24, distance_m=stick_m)
    assert found is not None
    assert (abs(found.pixel[1] - expected[1]) < 2.5) is right
