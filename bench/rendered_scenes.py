"""Rendered pairs with a known vergence error: a target before a furnished room, in any of the simulator's worlds."""

import math
from collections.abc import Iterator
from contextlib import closing

import numpy as np
from numpy.typing import NDArray

from vergence_rig.geometry import gaze_for_point
from vergence_sim.parameters import SimParameters
from vergence_sim.simulator import Simulator, StereoFrame

TARGETS = ("cube", "marker")


def look_at(simulator: Simulator, point_m: NDArray[np.float64], vergence_error_rad: float) -> StereoFrame:
    """Return what the eyes see when the left one looks at a point and the right one misses it by an angle.

    A positive error means that the eyes have to converge more, as in VergenceError.
    """
    angles = gaze_for_point(point_m, simulator.rig.baseline_m)
    simulator.set_head(
        {
            "pan_left": angles.pan_left_rad,
            "pan_right": angles.pan_right_rad - vergence_error_rad,
            "tilt": angles.tilt_rad,
        }
    )
    return simulator.capture()


def fixated_surface(simulator: Simulator, target: str, centre_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Put a target somewhere and return the point of its surface that a verged gaze meets [m], rig_base."""
    simulator.place_target(target, centre_m)
    return np.asarray(simulator.truth().target_point_m, np.float64)


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
    parameters: SimParameters, worlds: range, places: int, errors_rad: list[float], seed: int
) -> Iterator[tuple[float, StereoFrame]]:
    """Yield error and pair for `places` targets in each world, each seen with every error."""
    rng = np.random.default_rng(seed)
    for world in worlds:
        with closing(Simulator(parameters.replaced({"world.seed": world, "seed": seed}))) as simulator:
            for i in range(places):
                point = fixated_surface(simulator, TARGETS[i % len(TARGETS)], random_place(rng))
                for error_rad in errors_rad:
                    yield error_rad, look_at(simulator, point, error_rad)
