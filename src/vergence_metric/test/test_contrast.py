import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from vergence_metric.edges.contrast import contrasts, foveal_contrast, surface_contrast
from vergence_metric.edges.edges import Edges, detect_edges
from vergence_metric.edges.oriented_edges import OrientedField, oriented_field
from vergence_metric.edges.parameters import EdgeParameters
from vergence_metric.edges.windows import Window, centre_windows


def picture(seed: int, height: int = 200, width: int = 320) -> NDArray[np.uint8]:
    """Return overlapping polygons, larger than any view cut from them."""
    rng = np.random.default_rng(seed)
    image = np.full((height, width), 120, np.uint8)
    for _ in range(height * width // 600):
        corners = rng.uniform(0, (width, height)) + rng.uniform(-25, 25, (4, 2))
        cv2.fillConvexPoly(image, cv2.convexHull(corners.astype(np.int32)), int(rng.uniform(10, 245)))
    return image


def edges_of(image: NDArray[np.uint8]) -> Edges:
    return detect_edges(image, EdgeParameters())


def field(left: Edges, right: Edges, sizes: tuple[int, ...], truncation: int = 5, bins: int = 8) -> OrientedField:
    windows = centre_windows(sizes, *left.mask.shape)
    return oriented_field(left, right, windows, bins=bins, signed=True, truncation_px=truncation)


def distance_by_definition(edges: Edges, wanted: int, bins: int, truncation: float) -> NDArray[np.float64]:
    """Return the truncated distance to the edge pixels of one bin, over the whole image."""
    angle = np.arctan2(edges.gradient_y.astype(float), edges.gradient_x)
    of_bin = (edges.mask > 0) & (np.rint(angle % (2 * np.pi) / (2 * np.pi) * bins).astype(int) % bins == wanted)
    rows, columns = np.mgrid[: edges.mask.shape[0], : edges.mask.shape[1]]
    best = np.full(edges.mask.shape, truncation, float)
    for row, column in np.argwhere(of_bin):
        np.minimum(best, np.hypot(rows - row, columns - column), out=best)
    return best


def by_definition(from_: Edges, to: Edges, window: Window, bins: int, truncation: float) -> float:
    angle = np.arctan2(from_.gradient_y.astype(float), from_.gradient_x)
    bin_ = np.rint(angle % (2 * np.pi) / (2 * np.pi) * bins).astype(int) % bins
    figure = chance = 0.0
    for k in range(bins):
        at = (from_.mask > 0) & (bin_ == k)
        distance = distance_by_definition(to, k, bins, truncation)[window.slices]
        figure += distance[at[window.slices]].sum()
        chance += at[window.slices].sum() * distance.mean()
    return figure / chance


@pytest.mark.parametrize("truncation", [3, 5, 8])
def test_equal_to_the_definition_but_for_sampled_chance(truncation: int) -> None:
    left, right = edges_of(picture(5, 90, 110)), edges_of(picture(8, 90, 110))
    sizes = (24, 40, 70)  # the smallest is sampled at every pixel
    found = contrasts(field(left, right, sizes, truncation), truncation)
    for i, window in enumerate(centre_windows(sizes, 90, 110)):
        tolerance = 1e-6 if window.size_px == 24 else 0.03
        assert found.left_to_right[i] == pytest.approx(by_definition(left, right, window, 8, truncation), rel=tolerance)
        assert found.right_to_left[i] == pytest.approx(by_definition(right, left, window, 8, truncation), rel=tolerance)


@settings(deadline=None, max_examples=25)
@given(seed=st.integers(0, 1000), share=st.sampled_from((0.001, 0.02, 0.3)), truncation=st.integers(1, 15))
def test_distances_are_exact_for_any_edges(seed: int, share: float, truncation: int) -> None:
    rng = np.random.default_rng(seed)

    def random_edges() -> Edges:
        gradients = rng.integers(-300, 300, (2, 40, 50)).astype(np.int16)
        return Edges((rng.random((40, 50)) < share).astype(np.uint8) * np.uint8(255), gradients[0], gradients[1], 0, 0)

    left, right = random_edges(), random_edges()
    measured = field(left, right, (30, 64), truncation)
    points = measured.images[0]
    window = measured.windows[-1]
    rows, columns = points.places
    for k in range(8):
        expected = distance_by_definition(right, k, 8, truncation)[window.slices]
        of_bin = points.bin == k
        found = measured.distances_px(0, truncation)[of_bin]
        np.testing.assert_allclose(found, expected[rows[of_bin], columns[of_bin]], atol=1e-4)


def test_unrelated_images_read_about_one_and_alike_ones_zero() -> None:
    one, other = edges_of(picture(3)), edges_of(picture(4))
    unrelated = contrasts(field(one, other, (50, 100, 180)), 5).both
    np.testing.assert_allclose(unrelated, 1.0, atol=0.15)
    np.testing.assert_allclose(contrasts(field(one, one, (50, 100, 180)), 5).both, 0.0, atol=1e-6)


def test_it_rises_with_the_shift_and_does_not_feel_the_texture() -> None:
    for seed in range(5, 9):
        scene = picture(seed)
        left = edges_of(scene[:, 40:240])
        rising = [contrasts(field(left, edges_of(scene[:, 40 + d : 240 + d]), (100,)), 5).both[0] for d in (0, 2, 6)]
        assert rising[0] < 0.05
        assert 0.2 < rising[1] < 0.8
        assert rising[2] > 0.7


def test_a_narrower_cut_off_than_the_field_s_is_as_if_it_were_its_own() -> None:
    left, right = edges_of(picture(1)), edges_of(picture(2))
    wide, narrow = field(left, right, (100,), 9), field(left, right, (100,), 4)
    np.testing.assert_allclose(contrasts(wide, 4).both, contrasts(narrow, 4).both, rtol=1e-6)


def test_without_edges_it_is_nan() -> None:
    blank = edges_of(np.full((100, 100), 90, np.uint8))
    some = edges_of(picture(1, 100, 100))
    for pair in ((blank, some), (some, blank), (blank, blank)):
        found = contrasts(field(*pair, (50, 80)), 5)
        assert np.isnan([found.left_to_right, found.right_to_left, found.both]).all()


def test_edges_only_beyond_the_window_do_not_count() -> None:
    image = np.full((120, 120), 90, np.uint8)
    image[:20] = 200
    found = contrasts(field(edges_of(image), edges_of(image), (50, 120)), 5)
    assert np.isnan(found.both[0])
    assert found.both[1] == pytest.approx(0.0, abs=1e-6)


def verged_disc(radius: int) -> tuple[Edges, Edges]:
    """Return edges of views whose middle, a disc, is verged and whose surroundings are 20 px off."""
    near, far = picture(11), picture(12)
    views = [far[:, 40:240].copy(), far[:, 60:260].copy()]
    rows, columns = np.mgrid[:200, :200]
    inside = np.hypot(rows - 99.5, columns - 99.5) < radius
    for view in views:
        view[inside] = near[:, 40:240][inside]
    return edges_of(views[0]), edges_of(views[1])


def test_the_foveal_form_sees_a_target_smaller_than_the_window() -> None:
    small = field(*verged_disc(20), (50, 100))
    assert foveal_contrast(small, 5, 8.0) < 0.35
    assert contrasts(small, 5).both[1] > 0.6
    assert foveal_contrast(small, 5, 1e6) == pytest.approx(contrasts(small, 5).both[1], abs=0.01)
    unrelated = field(edges_of(picture(3)), edges_of(picture(4)), (50, 100))
    assert foveal_contrast(unrelated, 5, 14.0) == pytest.approx(1.0, abs=0.25)


def test_the_foveal_form_is_nan_without_edges() -> None:
    blank = edges_of(np.full((100, 100), 90, np.uint8))
    assert np.isnan(foveal_contrast(field(blank, edges_of(picture(1, 100, 100)), (50, 80)), 5, 14.0))


@pytest.mark.parametrize(("bins", "truncation"), [(0, 5), (9, 5), (8, 0), (8, 16)])
def test_what_the_planes_cannot_hold_is_refused(bins: int, truncation: int) -> None:
    edges = edges_of(picture(1))
    with pytest.raises(ValueError, match=f"got {truncation} and {bins}"):
        field(edges, edges, (50,), truncation, bins)


def verged_strip(off_px: int) -> OrientedField:
    """Return the edges of views with an upright strip 6 px wide in the middle, its surroundings 20 px off."""
    near, far = picture(11), picture(12)
    left, right = far[:, 40:240].copy(), far[:, 60:260].copy()
    left[:, 97:103] = near[:, 40:46]
    right[:, 97 - off_px : 103 - off_px] = near[:, 40:46]
    return field(edges_of(left), edges_of(right), (50, 100))


def test_a_thing_that_fills_little_of_every_window_has_a_contrast_of_its_own() -> None:
    support = np.zeros((80, 20), np.float32)
    support[:, 7:13] = 1.0
    corner = (50 - 10, 50 - 40)  # the window's corner is (50, 50) of the image, the strip's middle its (100, 100)
    verged, beside = verged_strip(0), verged_strip(9)
    assert contrasts(verged, 5).both.min() > 0.7
    assert surface_contrast(verged, 5, support, corner) < 0.6
    assert surface_contrast(beside, 5, support, corner) > 0.8


@pytest.mark.parametrize("corner", [(-500, 0), (0, 900), (90, 90)])
def test_a_surface_with_few_edge_pixels_in_the_window_has_no_contrast(corner: tuple[int, int]) -> None:
    support = np.ones((80, 20), np.float32)
    support[:10, :10] = 0.0
    assert np.isnan(surface_contrast(verged_strip(0), 5, support, corner))


def test_a_surface_that_fills_the_window_has_its_contrast() -> None:
    support = np.ones((300, 300), np.float32)
    seen = verged_strip(0)
    assert surface_contrast(seen, 5, support, (-100, -100)) == pytest.approx(contrasts(seen, 5).both[1], abs=1e-6)
