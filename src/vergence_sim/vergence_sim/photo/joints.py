"""The joints that turn the eyes before a photograph: servo plants that need not be those of rig.yaml."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from vergence_rig.rig import JOINT_NAMES, Rig
from vergence_rig.servo import ServoPlant, ServoSpec
from vergence_sim.head import CommandError


@dataclass(frozen=True)
class Plant:
    """How the real joints differ from the rig's description: the defaults differ in nothing.

    The shaft stands at `angle_scale` times what its servo goes to, plus `zero_rad` by joint name. `servo` takes the
    place of every described one; dead band and speed are multiplied.
    """

    servo: ServoSpec | None = None
    dead_band_scale: float = 1.0
    speed_scale: float = 1.0
    angle_scale: float = 1.0
    zero_rad: Mapping[str, float] = field(default_factory=dict)

    def spec(self, described: ServoSpec) -> ServoSpec:
        """Return the servo that is really there where the rig describes another."""
        servo = described if self.servo is None else self.servo
        return servo.replaced(
            dead_band_rad=servo.dead_band_rad * self.dead_band_scale, speed_rad_s=servo.speed_rad_s * self.speed_scale
        )


class PhotoHead:
    """Three joints by name: where their shafts are, and where a driver that has only the rig's description has them.

    Commands are limited to the rig's joint limits. `aside_rad` is where in its play each shaft rests at the start.
    """

    def __init__(self, rig: Rig, plant: Plant | None = None) -> None:
        self.rig, self.plant = rig, plant or Plant()
        self.place({})

    def place(
        self, angles_rad: Mapping[str, float], now_s: float = 0.0, aside_rad: Mapping[str, float] | None = None
    ) -> None:
        """Put the joints where a driver would report these angles (0 where none is given), at rest."""
        aside = aside_rad or {}
        self._plants: dict[str, ServoPlant] = {}
        self._models: dict[str, ServoPlant] = {}
        for name, joint in self.rig.joints.items():
            start = angles_rad.get(name, 0.0)
            self._plants[name] = ServoPlant(self.plant.spec(joint.servo), start + aside.get(name, 0.0), now_s)
            self._models[name] = ServoPlant(joint.servo, start, now_s)

    def command(self, angles_rad: Mapping[str, float], now_s: float) -> None:
        """Command joints by name [rad]; raises CommandError for an unknown name or an angle that is not finite."""
        for name, angle in angles_rad.items():
            if name not in self._plants:
                raise CommandError(f"a joint must be one of {', '.join(JOINT_NAMES)}: got {name!r}")
            if not math.isfinite(angle):
                raise CommandError(f"the command of {name} must be a finite angle [rad]: got {angle!r}")
        for name, angle in angles_rad.items():
            for joints in (self._plants, self._models):
                joints[name].command(self.rig.joints[name].clamp(angle), now_s)

    def step(self, now_s: float) -> None:
        """Move on to `now_s`."""
        for servo in (*self._plants.values(), *self._models.values()):
            servo.step(now_s)

    @property
    def true_rad(self) -> dict[str, float]:
        """Where the shafts are [rad]."""
        scale, zero = self.plant.angle_scale, self.plant.zero_rad
        return {name: scale * servo.true_rad + zero.get(name, 0.0) for name, servo in self._plants.items()}

    @property
    def velocity_rad_s(self) -> dict[str, float]:
        """How fast the shafts turn [rad/s]."""
        return {name: self.plant.angle_scale * servo.velocity_rad_s for name, servo in self._plants.items()}

    @property
    def modelled_rad(self) -> dict[str, float]:
        """Where a driver without feedback has the shafts [rad]."""
        return {name: servo.modelled_rad for name, servo in self._models.items()}
