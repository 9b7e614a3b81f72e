"""The simulated head's joints: servo plants that turn its axes, and what a driver without feedback makes of them."""

import math
from collections.abc import Mapping
from dataclasses import replace

from vergence_rig.rig import JOINT_NAMES, Joints, Rig
from vergence_rig.servo import PRESETS, ServoPlant
from vergence_sim.parameters import SimulationParameters


class CommandError(ValueError):
    """A joint command that is refused as a whole: nothing moves."""


class Head:
    """Three servo plants by joint name, of the real head, and three of the rig that a driver is given.

    Angles are the joints': what is commanded and reported. A command is limited to the driver's joint limits.
    """

    def __init__(self, rig: Rig, real: Rig | None = None) -> None:
        self.rig, self.real = rig, real or rig
        self._plants: dict[str, ServoPlant] = {}
        self._models: dict[str, ServoPlant] = {}
        self.place(dict.fromkeys(JOINT_NAMES, 0.0))

    def place(
        self, angles_rad: Mapping[str, float], now_s: float = 0.0, aside_rad: Mapping[str, float] | None = None
    ) -> None:
        """Put joints at angles [rad] at once, without their servos, at rest.

        Each shaft rests `aside_rad` off in its servo's play; a driver reports the angles themselves.
        """
        for name, angle in angles_rad.items():
            aside = 0.0 if aside_rad is None else aside_rad.get(name, 0.0)
            self._plants[name] = ServoPlant(self.real.joints[name].servo, angle + aside, now_s)
            self._models[name] = ServoPlant(self.rig.joints[name].servo, angle, now_s)

    def command(self, angles_rad: Mapping[str, float], now_s: float) -> None:
        """Command joints by name [rad]; raises CommandError for an unknown name or an angle that is not finite."""
        for name, angle in angles_rad.items():
            if name not in self._plants:
                raise CommandError(f"joint must be one of {', '.join(JOINT_NAMES)}: got {name!r}")
            if not (math.isfinite(angle) and abs(angle) < 1e9):
                raise CommandError(f"command of joint {name} must be a finite angle [rad]: got {angle!r}")
        for name, angle in angles_rad.items():
            for joints in (self._plants, self._models):
                joints[name].command(self.rig.joints[name].clamp(angle), now_s)

    def step(self, now_s: float) -> None:
        """Advance every servo to `now_s`."""
        for servo in (*self._plants.values(), *self._models.values()):
            servo.step(now_s)

    @property
    def true_rad(self) -> dict[str, float]:
        """True angles of the shafts, as joints [rad]."""
        return {name: plant.true_rad for name, plant in self._plants.items()}

    @property
    def axes_rad(self) -> dict[str, float]:
        """True angles of the axes, by joint name [rad]."""
        return {name: self.real.joints[name].axis_rad(plant.true_rad) for name, plant in self._plants.items()}

    @property
    def axis_speeds_rad_s(self) -> dict[str, float]:
        """True speeds of the axes, by joint name [rad/s]."""
        return {name: self.real.joints[name].scale * plant.velocity_rad_s for name, plant in self._plants.items()}

    @property
    def modelled_rad(self) -> dict[str, float]:
        """Angles of the joints that a driver without position feedback reports [rad]."""
        return {name: model.modelled_rad for name, model in self._models.items()}


def with_chosen_servos(rig: Rig, simulation: SimulationParameters) -> Rig:
    """Return a rig with the servos and the latency that the parameters choose, if they do."""
    rig = rig if simulation.servo == "rig" else rig.with_servos(PRESETS[simulation.servo])
    if simulation.servo_latency_s < 0:
        return rig
    joints = [
        replace(joint, servo=joint.servo.replaced(command_latency_s=simulation.servo_latency_s))
        for _, joint in rig.joints.items()
    ]
    return replace(rig, joints=Joints(*joints))
