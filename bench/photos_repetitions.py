"""How surely the edge contrast tells the repetitions of a texture apart on photographs, and the power that fits.

    python -m bench.photos_repetitions

Where the estimator says that a texture repeats, `vergence_metric.tracking.depth_evidence` weighs what it repeats by a
power of the contrast that each would have. Every other target fits the power, the others judge it.
"""

import math
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from bench.photos_data import pair_names, pair_of, photographs_rig, targets
from vergence_metric.disparity import make_estimator
from vergence_metric.disparity.parameters import DisparityParameters
from vergence_metric.disparity.protocol import DisparityStatus
from vergence_metric.edges.verged_contrast import contrasts_if_verged
from vergence_metric.measurement.edge_metric import EdgeMetric
from vergence_metric.tracking.depth_evidence import CONTRAST_POWER, LEAST_CONTRAST
from vergence_rig.servo import IDEAL
from vergence_sim.parameters import SimParameters
from vergence_sim.photo.world import PhotoWorld

Array = npt.NDArray[np.float64]

CLICKS = 24
OFF_DEG = (0.0, 1.0, -2.0)
POWERS = (0.0, -1.0, -2.0, -3.0, -4.0, -5.0, -6.0, -8.0)
_SAME_PX = 2.5
_FLOOR = 1e-3


@dataclass(frozen=True)
class Repetition:
    """What one pair offers at a point where a texture repeats: contrasts and likelihoods, and which are right."""

    contrast: Array
    likelihood: Array
    right: npt.NDArray[np.bool_]

    def share(self, power: float) -> float:
        """Return the probability that the right ones have."""
        weights = self.likelihood * (self.contrast + LEAST_CONTRAST) ** power
        return float(weights[self.right].sum() / weights.sum())


def seen() -> list[list[Repetition]]:
    """Return the repetitions at each target that has any, with the eyes verged on it and beside it."""
    cv2.setNumThreads(1)
    estimator, found = make_estimator(DisparityParameters()), list[list[Repetition]]()
    for name in pair_names():
        pair, metric = pair_of(name), EdgeMetric()
        parameters = SimParameters.of({"seed": 1, "head.model": "rolled"})
        world = PhotoWorld(pair, parameters, photographs_rig().with_servos(IDEAL))
        for target in targets(name, CLICKS):
            of_target = []
            for off_deg in OFF_DEG:
                pose = pair.fixation(target.point).as_dict()
                pose["pan_right"] += math.radians(off_deg)
                world.head.place(pose, 0.0, dict.fromkeys(pose, 0.0))
                views = metric.align(world.view("left"), world.view("right"))
                metric.update_alignment()
                at, there = (world.project(eye, target.point) for eye in ("left", "right"))
                disparity = estimator.estimate(views.left_grey, views.right_grey, at)
                if disparity.status is not DisparityStatus.AMBIGUOUS:
                    continue
                offered = np.array([(one.disparity_px, one.likelihood) for one in disparity.candidates])
                right = np.abs(offered[:, 0] - (at[0] - there[0])) <= _SAME_PX
                if right.any() and not right.all():
                    y = at[1] - disparity.vertical_px
                    places = [(at[0] - d, y) for d in offered[:, 0].tolist()]
                    contrast = contrasts_if_verged(views.left_grey, views.right_grey, at, places)
                    of_target.append(Repetition(np.nan_to_num(contrast, nan=1.0), offered[:, 1], right))
            if of_target:
                found.append(of_target)
    return found


def main() -> None:
    """Print, for each power, the mean log probability of the right repetition on both halves."""
    found = seen()
    print(f"{len(found)} targets with repetitions; shipped power {CONTRAST_POWER:g}")
    print(f"{'power':>6}{'fits':>8}{'judges':>8}{'right, judged':>15}")
    for power in POWERS:
        logs = [
            [np.mean([math.log(max(one.share(power), _FLOOR)) for one in of]) for of in found[k::2]] for k in (0, 1)
        ]
        right = np.mean([np.mean([one.share(power) for one in of]) for of in found[1::2]])
        print(f"{power:6g}{np.mean(logs[0]):8.3f}{np.mean(logs[1]):8.3f}{right:15.2f}")


if __name__ == "__main__":
    main()
