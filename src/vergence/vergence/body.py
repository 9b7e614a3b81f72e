"""What `Head` needs of the head that it steers: cameras that give pictures, joints that report and take commands."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from vergence_rig.camera import CameraModel
from vergence_rig.rig import Rig

Array = npt.NDArray[np.float64]
Pixels = npt.NDArray[np.uint8]


class BodyError(RuntimeError):
    """A head that cannot do what is asked of it, or that has ended."""


@dataclass(frozen=True)
class Picture:
    """One eye's picture (h, w, 3) BGR, exposed at `stamp_ns`; `side` is LEFT or RIGHT of `pairs.pairing`."""

    side: int
    stamp_ns: int
    pixels: Pixels


@dataclass(frozen=True)
class JointAngles:
    """The joints (3,) [rad], in the order of JOINT_NAMES, as the servos' driver reports them at `stamp_ns`."""

    stamp_ns: int
    angles_rad: Array


class Body(Protocol):
    """A head, real or not. All times are of one clock, `time_s`."""

    @property
    def rig(self) -> Rig:
        """The description that controller and metric are given."""

    @property
    def cameras(self) -> tuple[CameraModel | None, CameraModel | None]:
        """The calibrated cameras, left and right; None for one that only the rig describes."""

    @property
    def can_move(self) -> bool:
        """False for a head without servos."""

    @property
    def time_s(self) -> float:
        """The present."""

    def advance(self, duration_s: float) -> list[Picture | JointAngles]:
        """Go on by this long and return what has arrived, in order. Raises BodyError."""

    def command(self, joints_rad: Array) -> None:
        """Command the joints (3,) [rad]."""

    def close(self) -> None:
        """Release everything; harmless when nothing is open."""
