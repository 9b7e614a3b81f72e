"""Motion of a target about its place, as a function of time."""

import math

import numpy as np
import numpy.typing as npt

from vergence_sim.parameters import MotionParameters

Array = npt.NDArray[np.float64]


def offset_m(motion: MotionParameters, elapsed_s: float) -> Array:
    """Return the target's offset (3,) from its place [m], `elapsed_s` after its motion began."""
    extent = np.array([motion.x_m, motion.y_m, motion.z_m])
    if motion.kind == "step":
        return extent if elapsed_s >= 1.0 else np.zeros(3)
    if motion.kind == "ramp":
        return extent * elapsed_s
    if motion.kind == "sinusoid":
        return extent * math.sin(2 * math.pi * motion.frequency_hz * elapsed_s)
    if motion.kind == "stations":
        stations = np.reshape(motion.stations_m, (-1, 3))
        return np.array(stations[min(int(elapsed_s / motion.station_s), len(stations) - 1)], np.float64)
    return np.zeros(3)
