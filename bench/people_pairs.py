"""Whose face is whose: pairs of faces of persons side by side and crossing, with faces that one eye misses."""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from bench.results import Row
from vergence_metric.boxes.association import associate
from vergence_metric.boxes.detections import Box
from vergence_metric.boxes.parameters import AssociationParameters
from vergence_metric.testing.face_panels import FacePanel, FacePicture, PanelView
from vergence_metric.testing.face_pictures import astronaut, small_faces
from vergence_rig.geometry import EyeAngles
from vergence_rig.testing.ideal_eyes import gaze_for_point

VIEWS = 1000
_MISSED = 0.15
_JOINT_SIGMA_RAD = 0.004
_NEAR_M, _FAR_M = 0.5, 3.0
_HEAD_M = 0.2  # between two persons' faces beside each other


def rows(say: Callable[[str], None]) -> list[Row]:
    """Pair faces by landmarks, and by their boxes alone."""
    rng, view = np.random.default_rng(2026), PanelView(2026)
    faces = [astronaut(), *small_faces()]
    with_landmarks, boxes_alone = _Count(), _Count()
    for number in range(VIEWS):
        panels = _panels(rng, faces, 2 + number % 2)
        eyes = gaze_for_point(panels[0].point_m, view.rig.baseline_m)
        images, owners = view.images(panels, eyes, (1.0, float(rng.uniform(0.75, 1.2))))
        found = view.detections(panels, eyes, owners, miss_share=_MISSED)
        off = rng.normal(0.0, _JOINT_SIGMA_RAD, 2)
        geometry = view.geometry(EyeAngles(eyes.pan_left_rad + off[0], eyes.pan_right_rad + off[1], eyes.tilt_rad))
        plain = tuple({i: replace(box, landmarks_px=()) for i, box in of_eye.items()} for of_eye in found)
        for count, (left, right) in ((with_landmarks, found), (boxes_alone, plain)):
            pairs = associate(
                list(left.values()), list(right.values()), AssociationParameters(), 0.0, images, geometry
            ).pairs
            count.add(left, right, [(pair.left, pair.right) for pair in pairs if not pair.ambiguous])
        if number % 250 == 249:
            say(f"{number + 1} views: {with_landmarks}; without landmarks {boxes_alone}")
    like = "boxes without landmarks"
    return [
        Row("people.wrong_pairs", with_landmarks.wrong, f"of {VIEWS} views", like, boxes_alone.wrong),
        Row("people.paired_share", with_landmarks.share, "of faces that both eyes see", like, boxes_alone.share),
    ]


class _Count:
    """Right and wrong pairs, and how many faces were seen by both eyes."""

    def __init__(self) -> None:
        self.right = self.wrong = self.both = 0

    @property
    def share(self) -> float:
        """The share of the faces seen by both eyes that were paired."""
        return self.right / self.both

    def add(self, left: Mapping[int, Box], right: Mapping[int, Box], pairs: list[tuple[Box, Box]]) -> None:
        """Add what was paired in one view."""
        owner = {id(box): number for of_eye in (left, right) for number, box in of_eye.items()}
        same = sum(owner[id(a)] == owner[id(b)] for a, b in pairs)
        self.right, self.wrong = self.right + same, self.wrong + len(pairs) - same
        self.both += len(set(left) & set(right))

    def __str__(self) -> str:
        return f"{self.right} of {self.both} pairs right, {self.wrong} wrong"


def _panels(rng: np.random.Generator, faces: list[FacePicture], count: int) -> list[FacePanel]:
    """Return persons near one another: each a step beside or behind the first."""
    distance = float(np.exp(rng.uniform(math.log(_NEAR_M), math.log(_FAR_M))))
    azimuth = float(rng.uniform(-0.3, 0.3))
    chosen = rng.choice(len(faces), count, replace=False)
    panels = []
    for i, face in enumerate(chosen):
        depth = distance if i == 0 else min(max(distance * float(np.exp(rng.normal(0.0, 0.2))), _NEAR_M), _FAR_M)
        aside = azimuth + (0.0 if i == 0 else float(rng.normal(0.0, 1.2 * _HEAD_M)) / depth)
        panels.append(
            FacePanel(
                faces[face],
                (depth * math.cos(aside), depth * math.sin(aside), float(rng.normal(0.0, 0.05))),
                yaw_rad=float(rng.normal(0.0, 0.3)),
                roll_rad=float(rng.normal(0.0, 0.12)),
                gain=float(rng.uniform(0.7, 1.2)),
            )
        )
    return panels
