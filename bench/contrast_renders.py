"""The contrast benchmark's rendered pairs with a known vergence error: a target in a furnished room."""

import math
from collections.abc import Iterator
from contextlib import closing

import numpy as np
from numpy.typing import NDArray

from vergence_rig.rig import Rig
from vergence_sim.fixation import fixated_surface, look_at
from vergence_sim.parameters import SimParameters
from vergence_sim.simulator import Simulator, StereoFrame

TARGETS = ("cube", "marker")


def random_place(rng: np.random.Generator) -> NDArray[np.float64]:
    """Return a place in reach of the eyes, 0.3 to 1.2 m away."""
    distance, azimuth, elevation = rng.uniform(0.3, 1.2), rng.uniform(-0.4, 0.4), rng.uniform(-0.2, 0.25)
    return distance * np.array(
        [
            math.cos(azimuth) * math.cos(elevation),
            math.sin(azimuth) * math.cos(elevation),
            math.sin(elevation),
        ]
    )


def frames(
    parameters: SimParameters, worlds: range, places: int, errors_rad: list[float], seed: int, head: Rig | None = None
) -> Iterator[tuple[float, StereoFrame]]:
    """Yield error and pair for `places` targets in each world, each seen with every error; `head` as Simulator."""
    rng = np.random.default_rng(seed)
    for world in worlds:
        with closing(Simulator(parameters.replaced({"world.seed": world, "seed": seed}), head=head)) as simulator:
            for i in range(places):
                point = fixated_surface(simulator, TARGETS[i % len(TARGETS)], random_place(rng))
                for error_rad in errors_rad:
                    yield error_rad, look_at(simulator, point, error_rad)
