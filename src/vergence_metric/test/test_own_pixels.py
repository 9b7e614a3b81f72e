"""Which pixels are of a point's own surface, and a thin thing that is found beside a background that has moved."""

import cv2
import numpy as np
import pytest

from vergence_metric.tracking.eye_view import EyeView
from vergence_metric.tracking.own_pixels import SurfaceMasks, own_pixels
from vergence_metric.tracking.remembered_patch import RememberedPatch
from vergence_rig.camera import CameraModel
from vergence_rig.rig import default_rig

CAMERA = CameraModel(default_rig().left_camera)
AT, OWN_PX, BEHIND_PX, WIDTH_PX = (320.0, 240.0), 20, 2, 12
DISTANCE_M, LENS_M = 0.5, 0.006


def texture(seed, blur, contrast):
    image = np.random.default_rng(seed).normal(0.0, 1.0, (480, 1000)).astype(np.float32)
    image = cv2.GaussianBlur(image, (0, 0), blur)
    return np.clip(120.0 + contrast * image / image.std(), 0, 255).astype(np.uint8)


WALL, STICK = texture(1, 3.0, 30.0), texture(2, 2.0, 50.0)


def seen(stick_px, wall_px=0):
    """A wall, and before it an upright stick about a column; both shift to the left by as many pixels as given."""
    image = WALL[:, 100 + wall_px : 740 + wall_px].copy()
    first = round(AT[0]) - WIDTH_PX // 2 - stick_px
    image[:, first : first + WIDTH_PX] = STICK[:, :WIDTH_PX]
    return image


def test_own_pixels_are_those_of_the_stick_and_not_of_the_wall():
    left, right = seen(0), seen(OWN_PX, BEHIND_PX)
    mask = own_pixels(left, right, AT, OWN_PX, 48)
    inside = slice(round(AT[0]) - WIDTH_PX // 2, round(AT[0]) + WIDTH_PX // 2)
    rows = slice(round(AT[1]) - 44, round(AT[1]) + 44)
    assert (mask[rows, inside] > 0).mean() > 0.5
    beside = np.r_[round(AT[0]) - 40 : inside.start - 6, inside.stop + 6 : round(AT[0]) + 40]
    assert (mask[rows][:, beside] > 0).mean() < 0.02
    assert not mask[: round(AT[1]) - 48].any()


def test_edges_along_the_baseline_fit_at_every_disparity_and_are_left_out():
    stripes = np.tile((np.arange(480) // 6 % 2 * 80 + 80).astype(np.uint8)[:, None], (1, 640))
    assert not own_pixels(stripes, stripes, AT, 5.0, 48).any()


@pytest.mark.parametrize("at", [(2.0, 3.0), (637.0, 477.0)])
def test_at_the_rim_of_the_image_the_mask_ends_there(at):
    left, right = seen(0), seen(OWN_PX, BEHIND_PX)
    assert own_pixels(left, right, at, BEHIND_PX, 48).shape == left.shape


def test_a_surface_is_known_at_the_distances_of_its_request_alone():
    surface = SurfaceMasks(seen(0), seen(OWN_PX, BEHIND_PX), AT, [(0.1, OWN_PX), (0.05, BEHIND_PX)], 0.013)
    assert surface.mask(0.3, 1) is None
    own, behind = surface.mask(0.105, 1), surface.mask(0.05, 2)
    assert own is not None
    assert behind is not None
    assert own[240, 320]
    assert not behind[120, 160]
    assert surface.mask(0.105, 1) is own


def test_a_stick_is_found_where_its_background_has_moved_against_it():
    """The lens has moved aside: the stick is seen 6.5 px to the left by that, and the wall is not."""
    moved_px = round(CAMERA.fx_px * LENS_M / DISTANCE_M)
    surface = SurfaceMasks(seen(0), seen(OWN_PX, BEHIND_PX), AT, [(0.1, OWN_PX)], 0.013)
    patch = RememberedPatch(seen(0), EyeView(CAMERA, 0.0, 0.0), AT)
    view = EyeView(CAMERA, 0.0, 0.0, lens_m=(0.0, -LENS_M, 0.0))
    direction = view.direction_of(patch.direction, EyeView(CAMERA, 0.0, 0.0), DISTANCE_M)
    expected = view.pixel(direction)
    assert expected[0] == pytest.approx(AT[0] - moved_px, abs=1.0)
    now = seen(moved_px)
    found = patch.find(now, view, direction, 24, distance_m=DISTANCE_M, own=lambda scale: surface.mask(0.1, scale))
    assert found is not None
    assert found.pixel == pytest.approx((AT[0] - moved_px, AT[1]), abs=0.7)
    assert found.at_point > 0.9
    here, _ = patch.refine(now, view, (AT[0] - moved_px, AT[1]), 4, DISTANCE_M, lambda scale: surface.mask(0.1, scale))
    assert here.pixel == pytest.approx((AT[0] - moved_px, AT[1]), abs=0.7)
