"""The simulator's parameters in groups: the simulation, the world, the cameras, the target and its motion."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

from vergence_rig.parameters import Groups, ParameterError, Parameters, parameter, replaced_groups
from vergence_sim.camera_parameters import CameraParameters, RightCameraParameters
from vergence_sim.clock_parameters import ClockParameters
from vergence_sim.heads import HeadParameters
from vergence_sim.persons import PersonParameters

TARGETS = ("cube", "marker", "straw", "cable", "stick", "box")
DISTRACTORS = ("two", "four", "five", "die", "plain", "stripes")
MOTIONS = ("static", "step", "ramp", "sinusoid", "stations")
_MOST_EXTRA_CUBES, _MOST_LOOK_ALIKES = 3, 6
_LARGEST_SEED = 2**31 - 1


@dataclass(frozen=True)
class SimulationParameters(Parameters):
    """The simulated head as a whole."""

    rig: str = parameter("", "path of rig.yaml; empty for the built-in rig", read_only=True)
    preset: str = parameter(
        "realistic",
        "imperfections of head, servos and cameras: as the other parameters say (realistic), or none at all (ideal)",
        choices=("realistic", "ideal"),
        read_only=True,
    )
    servo: str = parameter(
        "rig",
        "servos that turn the head: its own, those of rig.yaml for a built-in head (rig), or all of one kind",
        choices=("rig", "sg90", "mg995", "ideal"),
        read_only=True,
    )
    servo_latency_s: float = parameter(
        -1.0,
        "time from a joint command to the servo's first motion; negative for the servo's own",
        unit="s",
        minimum=-1,
        maximum=1,
        read_only=True,
    )
    seed: int = parameter(
        0, "seed of sensor noise and of exposure jitter", minimum=0, maximum=_LARGEST_SEED, read_only=True
    )
    joint_rate_hz: float = parameter(
        50.0, "rate at which joint_states is published", unit="Hz", minimum=1, maximum=1000, read_only=True
    )
    rig_yaw_rate_rad_s: float = parameter(
        0.0,
        "speed at which the whole rig turns about the vertical, positive to the left",
        unit="rad/s",
        minimum=-5,
        maximum=5,
    )


@dataclass(frozen=True)
class WorldParameters(Parameters):
    """The room and what stands in it."""

    seed: int = parameter(
        0,
        "seed of the room: textures, furniture, the cube's colours",
        minimum=0,
        maximum=_LARGEST_SEED,
        read_only=True,
        formerly="world_seed",
    )
    light: float = parameter(
        1.0, "brightness of the room, 1 for normal", minimum=0.05, maximum=3.0, read_only=True, formerly="light"
    )
    extra_cubes: int = parameter(
        0,
        "number of further Rubik's cubes in the room, other than the target",
        minimum=0,
        maximum=_MOST_EXTRA_CUBES,
        read_only=True,
        formerly="extra_cubes",
    )
    look_alikes: int = parameter(
        0,
        "number of objects in the room that have a Rubik's cube's colours or pattern",
        minimum=0,
        maximum=_MOST_LOOK_ALIKES,
        read_only=True,
        formerly="look_alikes",
    )
    distractor: str = parameter(
        "four",
        "object that stands at sim/distractor_pose, 6 cm wide, in the cube's colours: a puzzle of 2, 4 or 5 cells a "
        "side, a die, a plain or a striped block",
        choices=DISTRACTORS,
        read_only=True,
        formerly="distractor",
    )
    samples_per_pixel: int = parameter(
        0,
        "samples of the renderer's antialiasing; 0 for none",
        minimum=0,
        maximum=16,
        read_only=True,
        formerly="samples",
    )


@dataclass(frozen=True)
class TargetParameters(Parameters):
    """Which object is the target and where it starts."""

    object: str = parameter("cube", "object that is the target", choices=TARGETS, formerly="target")
    x_m: float = parameter(
        0.8,
        "x of the target's centre at the start, in rig_base",
        unit="m",
        minimum=-100,
        maximum=100,
        read_only=True,
        formerly="start_x_m",
    )
    y_m: float = parameter(
        0.0,
        "y of the target's centre at the start, in rig_base",
        unit="m",
        minimum=-100,
        maximum=100,
        read_only=True,
        formerly="start_y_m",
    )
    z_m: float = parameter(
        0.0,
        "z of the target's centre at the start, in rig_base",
        unit="m",
        minimum=-100,
        maximum=100,
        read_only=True,
        formerly="start_z_m",
    )
    yaw_rad: float = parameter(
        0.0,
        "angle by which the target is turned about the vertical",
        unit="rad",
        minimum=-3.2,
        maximum=3.2,
        formerly="target_yaw_rad",
    )


@dataclass(frozen=True)
class MotionParameters(Parameters):
    """How the target moves about its place; a change starts the motion anew."""

    kind: str = parameter("static", "motion of the target about its place", choices=MOTIONS, formerly="motion")
    x_m: float = parameter(
        0.0,
        "extent of the target's motion along x: amplitude of a sinusoid, size of a step, way per second of a ramp",
        unit="m",
        minimum=-10,
        maximum=10,
        formerly="motion_x_m",
    )
    y_m: float = parameter(
        0.0,
        "extent of the target's motion along y: amplitude of a sinusoid, size of a step, way per second of a ramp",
        unit="m",
        minimum=-10,
        maximum=10,
        formerly="motion_y_m",
    )
    z_m: float = parameter(
        0.0,
        "extent of the target's motion along z: amplitude of a sinusoid, size of a step, way per second of a ramp",
        unit="m",
        minimum=-10,
        maximum=10,
        formerly="motion_z_m",
    )
    frequency_hz: float = parameter(
        0.2,
        "frequency of the sinusoid",
        unit="Hz",
        minimum=0.001,
        maximum=10,
        formerly="motion_frequency_hz",
    )
    stations_m: tuple[float, ...] = parameter(
        (0.0, 0.0, 0.0),
        "offsets x y z of one station after another from the target's place, for the motion stations",
        unit="m",
        minimum=-10,
        maximum=10,
        formerly="stations_m",
    )
    station_s: float = parameter(
        2.0,
        "time that the target stays at each station, for the motion stations",
        unit="s",
        minimum=0.01,
        maximum=3600,
        formerly="station_s",
    )

    def check(self) -> None:
        """Hold the stations to whole triples."""
        if len(self.stations_m) % 3 or not self.stations_m:
            raise ParameterError("stations_m", self.stations_m, "three numbers, x y z, for every station")


GROUPS: Groups = (
    ("", SimulationParameters),
    ("head.", HeadParameters),
    ("world.", WorldParameters),
    ("camera.", CameraParameters),
    ("right_camera.", RightCameraParameters),
    ("target.", TargetParameters),
    ("motion.", MotionParameters),
    ("persons.", PersonParameters),
)

NODE_GROUPS: Groups = (*GROUPS, ("clock.", ClockParameters))
"""Every parameter group of sim_node."""

_IDEAL: Mapping[str, Any] = {
    "servo": "ideal",
    "head.model": "ideal",
    "camera.frame_jitter_s": 0.0,
    "camera.exposure_s": 0.0,
    "camera.noise_sigma": 0.0,
    "camera.jpeg_quality": 0,
    "right_camera.clock_offset_s": 0.0,
    "right_camera.clock_drift": 0.0,
    "right_camera.gain": 1.0,
    "right_camera.blue_gain": 1.0,
    "right_camera.red_gain": 1.0,
}


@dataclass(frozen=True)
class SimParameters:
    """Every parameter group of the simulator, in the order of GROUPS. The defaults equal config/sim_node.yaml."""

    simulation: SimulationParameters = field(default_factory=SimulationParameters)
    head: HeadParameters = field(default_factory=HeadParameters)
    world: WorldParameters = field(default_factory=WorldParameters)
    camera: CameraParameters = field(default_factory=CameraParameters)
    right_camera: RightCameraParameters = field(default_factory=RightCameraParameters)
    target: TargetParameters = field(default_factory=TargetParameters)
    motion: MotionParameters = field(default_factory=MotionParameters)
    persons: PersonParameters = field(default_factory=PersonParameters)

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> "SimParameters":
        """Return the defaults with some values changed, by their full names such as "world.seed"."""
        return cls().replaced(values)

    @classmethod
    def ideal(cls, values: Mapping[str, Any] | None = None) -> "SimParameters":
        """Return the set without any imperfection, some other values changed by their full names."""
        return cls.of({"preset": "ideal", **(values or {})}).effective()

    def replaced(self, values: Mapping[str, Any]) -> "SimParameters":
        """Return a validated copy with some values changed by their full names; raises ParameterError."""
        current = (getattr(self, member.name) for member in fields(self))
        groups: tuple[Any, ...] = replaced_groups(GROUPS, values, current)
        return SimParameters(*groups)

    def effective(self) -> "SimParameters":
        """Return the set with the preset applied."""
        return self.replaced(_IDEAL) if self.simulation.preset == "ideal" else self
