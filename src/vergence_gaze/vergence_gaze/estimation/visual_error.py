"""The newest measurement of the target, as the control laws read it."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class VisualError:
    """Where the target was and how far the axes were from it, by joint (3,) [rad].

    `target_rad` are the joint angles that would have fixated it, `error_rad` those minus the shafts' at the stamp. A
    joint whose error was not measured is NaN: the right pan while only the left eye sees the target.
    """

    stamp_s: float
    target_rad: Array
    error_rad: Array


@dataclass(frozen=True)
class ContrastSample:
    """The newest unsigned measurement: edge contrast and metric I [px], and the vergence they were measured at [rad].

    `resting` is False if the eyes were turning too fast for the pair to count.
    """

    stamp_s: float
    contrast: float
    metric_px: float
    vergence_rad: float
    resting: bool
