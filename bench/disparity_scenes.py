"""Rendered scenes for the benchmarks of disparity at the fovea: the cube in the furnished room, nearly fixated."""

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_rig.testing.ideal_eyes import gaze_for_point
from vergence_sim.parameters import SimParameters
from vergence_sim.simulator import Simulator
from vergence_sim.truth import Truth

Image = NDArray[np.uint8]


@dataclass(frozen=True)
class Scene:
    """A grey pair that needs no alignment, with the simulator's ground truth. `distance_m` is to the target."""

    left: Image
    right: Image
    truth: Truth
    distance_m: float

    @property
    def disparity_px(self) -> float:
        """True disparity of the target point."""
        return self.truth.left_px[0] - self.truth.right_px[0]


def scenes(
    count: int, seed: int, misverged_px: float, near_m: float = 0.3, far_m: float = 2.0, worlds: int = 4
) -> Iterator[Scene]:
    """Yield scenes with the cube anywhere from near to far, the right eye off by up to `misverged_px`.

    Noise, exposure difference and JPEG are the simulator's realistic defaults; roll, pitch and lens distortion, which
    the alignment stage removes before, are off.
    """
    rng = np.random.default_rng(seed)
    for world in range(worlds):
        parameters = SimParameters.of(
            {
                "servo": "ideal",
                "seed": world,
                "world.seed": world,
                "head.model": "ideal",
            }
        )
        simulator = Simulator(parameters)
        try:
            for _ in range(-(-count // worlds)):
                distance_m = float(np.exp(rng.uniform(np.log(near_m), np.log(far_m))))
                center_m = distance_m * np.array([1.0, rng.uniform(-0.25, 0.25), rng.uniform(-0.15, 0.2)])
                simulator.place_target("cube", center_m)
                eyes = gaze_for_point(simulator.truth().target_point_m, simulator.rig.baseline_m)
                off_rad = rng.uniform(-misverged_px, misverged_px) / simulator.rig.left_camera.fx_px
                simulator.set_head(eyes.as_dict() | {"pan_right": eyes.pan_right_rad + off_rad})
                frame = simulator.capture()
                left, right = (cv2.cvtColor(image, cv2.COLOR_BGR2GRAY) for image in (frame.left, frame.right))
                yield Scene(left, right, frame.truth, distance_m)
        finally:
            simulator.close()
