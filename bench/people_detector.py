"""A detector of persons in the simulated room: true boxes with noise.

Some persons are missed, some boxes are of nothing, and a person that another one hides by half is not found.
"""

from typing import Any

import numpy as np

from vergence_metric.boxes.detections import Detections, make_detections
from vergence_sim.persons import PERSON_CLASS, PERSONS
from vergence_sim.simulator import Simulator
from vergence_sim.truth import TrueBox

_NOISE_PX, _MISSED, _FALSE = 1.5, 0.05, 0.02
_HIDDEN_SHARE = 0.5


class NoDetector:
    """Stands for the detector of a BoxMeasurement that is given detections: it is asked for its input's size only."""

    input_px = (640, 480)


def detected(simulator: Simulator, eye: str, random: np.random.Generator) -> tuple[Detections, dict[Any, int]]:
    """Return what a detector would find in an eye's image, and of each box's sides whose it is, -1 for none."""
    boxes = {i: simulator.true_box(eye, PERSONS[i]) for i in range(simulator.parameters.persons.count)}
    named = {i: box for i, box in boxes.items() if box is not None}
    sides, whose = [], []
    for number, box in sorted(named.items()):
        nearer = [o for n, o in named.items() if simulator.person_place_m(n)[0] < simulator.person_place_m(number)[0]]
        if random.random() < _MISSED or max((_covered(box, o) for o in nearer), default=0.0) > _HIDDEN_SHARE:
            continue
        sides.append(
            np.array([box.x_min_px, box.y_min_px, box.x_max_px, box.y_max_px]) + random.normal(0, _NOISE_PX, 4)
        )
        whose.append(number)
    if random.random() < _FALSE:
        x, y = random.uniform((60, 60), (500, 300))
        sides.append(np.array([x, y, x + 70, y + 95]))
        whose.append(-1)
    xyxy = np.array(sides).reshape(-1, 4)
    scores = np.clip(random.normal(0.85, 0.05, len(sides)), 0.0, 1.0)
    found = make_detections(xyxy, scores, np.zeros(len(sides), np.int64), (PERSON_CLASS,), (640, 480))
    order = np.argsort(-scores, kind="stable")
    return found, {box.xyxy_px: whose[i] for box, i in zip(found.boxes(), order, strict=True)}


def _covered(box: TrueBox, other: TrueBox) -> float:
    """Return the share of a box that another covers."""
    width = min(box.x_max_px, other.x_max_px) - max(box.x_min_px, other.x_min_px)
    height = min(box.y_max_px, other.y_max_px) - max(box.y_min_px, other.y_min_px)
    whole = (box.x_max_px - box.x_min_px) * (box.y_max_px - box.y_min_px)
    return max(width, 0.0) * max(height, 0.0) / max(whole, 1e-9)
