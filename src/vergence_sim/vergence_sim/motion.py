"""How a target moves about its place: pure functions of time."""

import math

import numpy as np
import numpy.typing as npt

from vergence_sim.parameters import SimParameters

Array = npt.NDArray[np.float64]


def offset_m(parameters: SimParameters, elapsed_s: float) -> Array:
    """Return where the target is (3,) from its place, `elapsed_s` after its motion began [m]."""
    extent = np.array([parameters.motion_x_m, parameters.motion_y_m, parameters.motion_z_m])
    if parameters.motion == "step":
        return extent if elapsed_s >= 1.0 else np.zeros(3)
    if parameters.motion == "ramp":
        return extent * elapsed_s
    if parameters.motion == "sinusoid":
        return extent * math.sin(2 * math.pi * parameters.motion_frequency_hz * elapsed_s)
    if parameters.motion == "stations":
        stations = np.reshape(parameters.stations_m, (-1, 3))
        return np.array(stations[min(int(elapsed_s / parameters.station_s), len(stations) - 1)], np.float64)
    return np.zeros(3)
