"""The recording of one moving axis. Times are seconds of one clock, angles are joint angles [rad]."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
import numpy.typing as npt

from vergence_calibration.eye_turn import Image
from vergence_rig.camera import CameraModel
from vergence_rig.parameters import Parameters, parameter

Array = npt.NDArray[np.float64]

EYES = ("left", "right")


class IdentifyError(ValueError):
    """A head that cannot be identified or is connected wrongly: the message says what must hold and what was got."""


@dataclass(frozen=True)
class IdentifyParameters(Parameters):
    """How each axis is moved."""

    amplitude_deg: float = parameter(
        3.0, "amplitude of every move in either direction", unit="degrees", minimum=1, maximum=15
    )
    stairs: int = parameter(8, "steps of the staircase from which gain and lost motion follow", minimum=6, maximum=40)
    steps: int = parameter(14, "number of steps from which the latencies follow", minimum=6, maximum=100)
    rest_s: float = parameter(0.45, "rest after every move, longer than any latency", unit="s", minimum=0.2, maximum=5)


@dataclass(frozen=True)
class Move:
    """One command: angle from the pose [rad], rest after it, and a further share of a frame period.

    The share spreads the commands over the phases of the camera: the more phases, the more accurate the latency.
    """

    angle_rad: float
    rest_s: float
    share: float


@dataclass
class Frames:
    """One eye's pictures in order: stamps and times of arrival [s], and the pictures, possibly reduced in size."""

    stamps_s: list[float] = field(default_factory=list)
    arrivals_s: list[float] = field(default_factory=list)
    pictures: list[Image] = field(default_factory=list)

    def add(self, stamp_s: float, arrival_s: float, picture: Image) -> None:
        """Append a frame; one whose stamp does not increase is left out."""
        if not self.stamps_s or stamp_s > self.stamps_s[-1]:
            self.stamps_s.append(stamp_s)
            self.arrivals_s.append(arrival_s)
            self.pictures.append(picture)


@dataclass(frozen=True)
class AxisLog:
    """One axis's run: commands and joint reports, (n, 2) of stamp and angle, and both eyes' pictures."""

    joint: str
    commands: Array
    reports: Array
    frames: dict[str, Frames]


@dataclass(frozen=True)
class EyeCamera:
    """An eye's camera: its model, and whether it is calibrated or the rig's."""

    model: CameraModel
    calibrated: bool


class Head(Protocol):
    """A head whose joints can be commanded and whose images can be recorded."""

    def cameras(self) -> Mapping[str, EyeCamera]:
        """Return the cameras by eye. Raises IdentifyError."""

    def record(self, joint: str, moves: Sequence[Move]) -> AxisLog:
        """Make the moves of one joint about the pose and return the recording. Raises IdentifyError."""


def stair_moves(angles_rad: Sequence[float], rest_s: float) -> list[Move]:
    """Return a staircase's moves, about the pose."""
    return [Move(angle, rest_s, 0.0) for angle in angles_rad]


def step_moves(amplitude_rad: float, steps: int, rest_s: float) -> list[Move]:
    """Return moves from one side to the other and back, whose phases cover the camera's period evenly."""
    golden = 0.5 * (math.sqrt(5.0) - 1.0)
    return [Move(amplitude_rad if k % 2 else -amplitude_rad, rest_s, (k * golden) % 1.0) for k in range(steps + 1)] + [
        Move(0.0, rest_s, 0.0)
    ]
