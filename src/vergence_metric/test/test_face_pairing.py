"""Whose face is whose: never the left eye's face of one person with the right eye's of another."""

import math
from dataclasses import replace

import numpy as np
import pytest

from vergence_metric.boxes.association import associate
from vergence_metric.boxes.face_pairing import face_cost
from vergence_metric.boxes.parameters import AssociationParameters
from vergence_metric.boxes.patch_descriptor import descriptor_correlation, patch_descriptor
from vergence_metric.testing.face_panels import FacePanel, FacePicture, PanelView
from vergence_rig.geometry import EyeAngles
from vergence_rig.testing.ideal_eyes import gaze_for_point

P = AssociationParameters()
BASELINE_M = PanelView().rig.baseline_m


def drawn_face(seed):
    """A face that no package carries: patches of brightness with landmarks at a face's places."""
    rng = np.random.default_rng(seed)
    coarse = rng.uniform(20, 235, (9, 8, 3)).astype(np.float32)
    image = np.repeat(np.repeat(coarse, 16, 0), 16, 1).astype(np.uint8)
    landmarks = np.array([(40, 50), (88, 50), (64, 80), (46, 104), (82, 104)], float) + rng.normal(0, 2.0, (5, 2))
    return FacePicture(image, (10.0, 8.0, 118.0, 136.0), landmarks)


FACES = [drawn_face(seed) for seed in range(12)]


def seen(view, panels, at, miss_share=0.0, angle_error_rad=0.0, gains=(1.0, 1.0)):
    """Images, each eye's boxes by panel, and the geometry of eyes that fixate a point."""
    eyes = gaze_for_point(at, BASELINE_M)
    images, owners = view.images(panels, eyes, gains)
    found = view.detections(panels, eyes, owners, miss_share=miss_share)
    reported = EyeAngles(eyes.pan_left_rad - angle_error_rad, eyes.pan_right_rad + angle_error_rad, eyes.tilt_rad)
    return images, found, view.geometry(reported)


def pairs_of(images, found, geometry):
    """(left panel, right panel) of each pair, without the ambiguous ones."""
    owner = {id(box): number for of_eye in found for number, box in of_eye.items()}
    paired = associate(list(found[0].values()), list(found[1].values()), P, 0.0, images, geometry)
    return [(owner[id(p.left)], owner[id(p.right)]) for p in paired.pairs if not p.ambiguous]


@pytest.mark.parametrize("distance_m", [0.5, 1.0, 2.0, 3.0])
def test_two_persons_side_by_side_are_paired_right(distance_m):
    view = PanelView(1)
    aside = min(0.11, 0.2 * distance_m)
    panels = [
        FacePanel(FACES[0], (distance_m, aside, 0.0), yaw_rad=0.3),
        FacePanel(FACES[1], (1.03 * distance_m, -aside, 0.01), yaw_rad=-0.2),
    ]
    images, found, geometry = seen(view, panels, (distance_m, 0.0, 0.0), gains=(1.0, 0.8))
    assert sorted(pairs_of(images, found, geometry)) == [(0, 0), (1, 1)]


@pytest.mark.parametrize("distance_m", [0.6, 1.0, 2.0])
def test_of_two_persons_of_whom_each_eye_misses_one_no_pair_is_made(distance_m):
    """The same size, the same row: it is their looks and the depth that their sizes say."""
    view = PanelView(2)
    panels = [
        FacePanel(FACES[2], (distance_m, 0.1, 0.0)),
        FacePanel(FACES[3], (distance_m, -0.1, 0.0)),
    ]
    images, found, geometry = seen(view, panels, (distance_m, 0.0, 0.0))
    for left, right in ((0, 1), (1, 0)):
        one_each = {left: found[0][left]}, {right: found[1][right]}
        assert pairs_of(images, one_each, geometry) == []


def test_a_third_person_whom_one_eye_misses_does_not_disturb_the_others():
    view = PanelView(3)
    panels = [FacePanel(FACES[i], (1.2, y, 0.0)) for i, y in ((4, 0.25), (5, 0.0), (6, -0.25))]
    images, found, geometry = seen(view, panels, (1.2, 0.0, 0.0))
    for missing in range(3):
        right = {number: box for number, box in found[1].items() if number != missing}
        assert sorted(pairs_of(images, (found[0], right), geometry)) == [(i, i) for i in range(3) if i != missing]


def test_no_wrong_pair_while_two_and_three_cross():
    """Persons walk past one another at any distance, with faces missed in one eye and joints that err."""
    rng = np.random.default_rng(7)
    view, right, wrong = PanelView(4), 0, []
    for step in range(60):
        distance_m = float(rng.uniform(0.6, 2.8))
        count = 2 + step % 2
        panels = [
            FacePanel(
                FACES[(step + 3 * i) % len(FACES)],
                (
                    distance_m * float(rng.uniform(0.85, 1.15)),
                    distance_m * float(rng.uniform(-0.3, 0.3)),
                    float(rng.normal(0.0, 0.03)),
                ),
                yaw_rad=float(rng.normal(0.0, 0.3)),
                roll_rad=float(rng.normal(0.0, 0.1)),
                gain=float(rng.uniform(0.7, 1.2)),
            )
            for i in range(count)
        ]
        found = seen(view, panels, (distance_m, 0.0, 0.0), 0.15, float(rng.normal(0.0, 0.003)))
        for left, other in pairs_of(*found):
            right += left == other
            if left != other:
                wrong.append((step, left, other))
    assert wrong == []
    assert right > 60


def test_looks_are_compared_where_the_landmarks_are():
    """The background of a turned head is in its box, not between its landmarks."""
    view = PanelView(5)
    panels = [FacePanel(FACES[7], (0.8, 0.08, 0.0), roll_rad=0.4), FacePanel(FACES[8], (0.8, -0.08, 0.0), roll_rad=0.4)]
    images, found, _ = seen(view, panels, (0.8, 0.0, 0.0), gains=(1.0, 0.7))
    looks = [[patch_descriptor(image, found[i][n]) for n in (0, 1)] for i, image in enumerate(images)]
    for n in (0, 1):
        same, other = (descriptor_correlation(looks[0][n], looks[1][m]) for m in (n, 1 - n))
        assert same is not None
        assert other is not None
        assert same > 0.8
        assert same > other + 0.4


def test_a_face_out_of_the_image_or_of_one_point_has_no_looks():
    image = np.random.default_rng(1).integers(0, 255, (100, 100, 3)).astype(np.uint8)
    view = PanelView(6)
    (face,) = seen(view, [FacePanel(FACES[9], (1.0, 0.0, 0.0))], (1.0, 0.0, 0.0))[1][0].values()
    assert (
        patch_descriptor(image, replace(face, landmarks_px=tuple((x + 1e4, y) for x, y in face.landmarks_px))) is None
    )
    assert patch_descriptor(image, replace(face, landmarks_px=((50.0, 50.0),) * 5)) is None
    assert face_cost(replace(face, landmarks_px=((50.0, 50.0),) * 5), face, None) == math.inf


def test_a_face_s_size_says_how_deep_it_is():
    """A picture of a face, half a person's size, is still paired; another person's parallax costs too much."""
    view = PanelView(8)
    costs = {}
    for scale in (1.0, 0.5):
        _, found, geometry = seen(
            view, [FacePanel(FACES[10], (0.9, 0.0, 0.0), eye_distance_m=0.063 * scale)], (0.9, 0, 0)
        )
        costs[scale] = face_cost(found[0][0], found[1][0], geometry)
        assert pairs_of(None, found, geometry) == [(0, 0)]
    assert costs[1.0] < 6.0 < costs[0.5] < P.max_cost
    _, found, geometry = seen(view, [FacePanel(FACES[10], (2.0, 0.0, 0.0))], (2.0, 0.0, 0.0))
    shifted = replace(found[1][0], landmarks_px=tuple((x - 150.0, y) for x, y in found[1][0].landmarks_px))
    assert face_cost(found[0][0], shifted, geometry) > 15.0
    assert face_cost(found[0][0], shifted, None) < 6.0
