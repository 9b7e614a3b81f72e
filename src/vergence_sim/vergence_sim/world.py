"""What a lockstep world offers to whatever runs it, in real time or not: a simulated room, or photographs."""

from collections.abc import Callable, Mapping
from typing import Protocol

import numpy as np
import numpy.typing as npt

from vergence_rig.rig import CameraSpec
from vergence_sim.optics import Lens
from vergence_sim.parameters import SimParameters

Picture = npt.NDArray[np.uint8]

EYES = ("left", "right")


class World(Protocol):
    """A head and what it sees, in lockstep."""

    parameters: SimParameters
    time_s: float

    @property
    def lenses(self) -> Mapping[str, Lens]:
        """The lenses of both eyes."""

    @property
    def calibrations(self) -> Mapping[str, CameraSpec | None]:
        """What both cameras publish of themselves, by eye; None for one that is not calibrated."""

    def set_parameters(self, parameters: SimParameters) -> None:
        """Change the parameters that are not fixed at the start."""

    def command(self, angles_rad: Mapping[str, float], now_s: float | None = None) -> None:
        """Command joints by name [rad]."""

    def advance_to(self, time_s: float) -> None:
        """Let time pass until `time_s`."""

    def expose(self, eye: str) -> Callable[[], Picture]:
        """Expose one eye now; what is returned makes the picture of it."""

    def joint_states(self) -> dict[str, float]:
        """Return the joint angles as a driver without feedback publishes them [rad]."""

    def true_joints(self) -> dict[str, float]:
        """Return where the shafts really are, as joints [rad]."""

    def close(self) -> None:
        """Free what the world holds."""
