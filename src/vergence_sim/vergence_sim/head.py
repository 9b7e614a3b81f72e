"""The simulated head's joints: servo plants that turn MuJoCo's hinges."""

from collections.abc import Mapping
from dataclasses import replace

from vergence_rig.rig import JOINT_NAMES, Joints, Rig
from vergence_rig.servo import PRESETS, ServoPlant
from vergence_sim.parameters import SimParameters


class CommandError(ValueError):
    """A joint command that is refused as a whole: nothing moves."""


class Head:
    """Three servo plants by joint name; a command is limited to the rig's joint limits."""

    def __init__(self, rig: Rig, parameters: SimParameters) -> None:
        simulation = parameters.simulation
        rig = rig if simulation.servo == "rig" else rig.with_servos(PRESETS[simulation.servo])
        if simulation.servo_latency_s >= 0:
            joints = [
                replace(joint, servo=joint.servo.replaced(command_latency_s=simulation.servo_latency_s))
                for _, joint in rig.joints.items()
            ]
            rig = replace(rig, joints=Joints(*joints))
        self.rig = rig
        self._plants = {name: ServoPlant(joint.servo, 0.0) for name, joint in self.rig.joints.items()}

    def command(self, angles_rad: Mapping[str, float], now_s: float) -> None:
        """Command joints by name [rad]; raises CommandError for an unknown name or an angle that is not finite."""
        for name, angle in angles_rad.items():
            if name not in self._plants:
                raise CommandError(f"joint must be one of {', '.join(JOINT_NAMES)}: got {name!r}")
            if not abs(angle) < 1e9:
                raise CommandError(f"command of joint {name} must be a finite angle [rad]: got {angle!r}")
        for name, angle in angles_rad.items():
            self._plants[name].command(self.rig.joints[name].clamp(angle), now_s)

    def step(self, now_s: float) -> None:
        """Advance every servo to `now_s`."""
        for plant in self._plants.values():
            plant.step(now_s)

    def place(self, angles_rad: Mapping[str, float], now_s: float) -> None:
        """Set the joints' angles [rad] at once, without their servos."""
        for name, angle in angles_rad.items():
            self._plants[name] = ServoPlant(self.rig.joints[name].servo, angle, now_s)

    @property
    def true_rad(self) -> dict[str, float]:
        """True angles of the shafts."""
        return {name: plant.true_rad for name, plant in self._plants.items()}

    @property
    def velocity_rad_s(self) -> dict[str, float]:
        """True speeds of the shafts."""
        return {name: plant.velocity_rad_s for name, plant in self._plants.items()}

    @property
    def modelled_rad(self) -> dict[str, float]:
        """Angles that a driver without position feedback reports."""
        return {name: plant.modelled_rad for name, plant in self._plants.items()}
