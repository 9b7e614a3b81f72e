"""The edge contrast of a target on photographs at vergence and off it, and the limits that `verged` has of it.

    python -m bench.photos_contrast

prints how the limits are chosen. Every other pair fits them, the others judge them: `photo.contrast.*`. Each view is an
exact homography of a photograph, with the simulator's camera imperfections; the eyes fixate a target, or the right one
is turned past it.
"""

import math
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from bench.photos_data import pair_names, pair_of, photographs_rig, targets
from bench.results import Row
from vergence_metric.disparity import make_estimator
from vergence_metric.disparity.parameters import DisparityParameters
from vergence_metric.measurement.edge_metric import EdgeMetric
from vergence_rig.servo import IDEAL
from vergence_rig.verged import VergedLimits
from vergence_sim.parameters import SimParameters
from vergence_sim.photo.world import PhotoWorld

Array = npt.NDArray[np.float64]

CLICKS = 8
OFF_DEG = (1.0, -1.0, 2.0, -2.0, 4.0, -4.0)
_KEPT_SHARE = 0.99
_CHANCE = 1.0


@dataclass(frozen=True)
class Contrasts:
    """The contrast of targets that are fixated, and with one eye turned past them: that which the tracker states."""

    verged: Array
    off: Array


def measured(names: list[str]) -> Contrasts:
    """Return the contrasts on these pairs; views without edges have none and are left out."""
    cv2.setNumThreads(1)
    estimator, verged = make_estimator(DisparityParameters()), list[float]()
    off: list[float] = []
    for name in names:
        pair, metric = pair_of(name), EdgeMetric()
        parameters = SimParameters.of({"seed": 1, "head.model": "rolled"})
        world = PhotoWorld(pair, parameters, photographs_rig().with_servos(IDEAL))
        for target in targets(name, CLICKS):
            for off_deg in (0.0, *OFF_DEG):
                pose = pair.fixation(target.point).as_dict()
                pose["pan_right"] += math.radians(off_deg)
                world.head.place(pose, 0.0, dict.fromkeys(pose, 0.0))
                seen = metric.measure(world.view("left"), world.view("right"))
                metric.update_alignment()
                surface = estimator.estimate(seen.left_grey, seen.right_grey).surface
                contrast = seen.target_contrast(surface).contrast
                if math.isfinite(contrast):
                    (off if off_deg else verged).append(contrast)
    return Contrasts(np.array(verged), np.array(off))


def limits_of(contrasts: Contrasts) -> tuple[float, float]:
    """Return the limits that fit: to enter, to leave.

    Contrast alone does not tell where the eyes look: it only forbids `verged` where it speaks against it. So it keeps
    99 % of what is verged, and what is verged already up to half way from the worst of them to chance.
    """
    enter = float(np.quantile(contrasts.verged, _KEPT_SHARE))
    return enter, 0.5 * (float(contrasts.verged.max()) + _CHANCE)


def rows() -> list[Row]:
    """Return the shares of the judging half: true fixations that pass, wrong ones that are refused."""
    names, limits = pair_names(), VergedLimits()
    judged = measured(names[1::2])
    return [
        Row("photo.contrast.verged_passed", float(np.mean(judged.verged <= limits.contrast_enter)), "share"),
        Row("photo.contrast.off_refused", float(np.mean(judged.off > limits.contrast_enter)), "share"),
    ]


def main() -> None:
    """Print what fits one half, beside the shipped limits, and how those do on the other half."""
    fitted, limits = measured(pair_names()[::2]), VergedLimits()
    enter, leave = limits_of(fitted)
    print(f"{len(fitted.verged)} fixations: to enter {enter:.2f} (shipped {limits.contrast_enter:g})")
    print(f"to leave {leave:.2f} (shipped {limits.contrast_leave:g})")
    for row in rows():
        print(f"{row.what}: {row.value:.3f}")


if __name__ == "__main__":
    main()
