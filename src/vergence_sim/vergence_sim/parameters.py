"""The simulator's parameters: imperfections of cameras and servos, the world, the target."""

from dataclasses import dataclass

from vergence_rig.parameters import Groups, ParameterError, Parameters, parameter

TARGETS = ("cube", "marker")
DISTRACTORS = ("two", "four", "five", "die", "plain", "stripes")
MOTIONS = ("static", "step", "ramp", "sinusoid", "stations")
_MOST_EXTRA_CUBES, _MOST_LOOK_ALIKES = 3, 6


@dataclass(frozen=True)
class SimParameters(Parameters):
    """What can be set about the simulation. Defaults equal config/sim_node.yaml: realistic, and not zero."""

    rig: str = parameter("", "path of rig.yaml; empty for the built-in rig", read_only=True)
    preset: str = parameter(
        "realistic",
        "realistic: as the values below say; ideal: ideal servos and cameras, whatever they say",
        choices=("realistic", "ideal"),
        read_only=True,
    )
    servo: str = parameter(
        "rig",
        "which servos turn the head; rig: those of rig.yaml",
        choices=("rig", "sg90", "mg995", "ideal"),
        read_only=True,
    )
    servo_latency_s: float = parameter(
        -1.0, "command to first motion; negative for the servo's own", unit="s", minimum=-1, maximum=1, read_only=True
    )
    seed: int = parameter(0, "of noise and jitter", minimum=0, maximum=2**31 - 1, read_only=True)
    world_seed: int = parameter(
        0, "of the room: textures, furniture, the cube's colours", minimum=0, maximum=2**31 - 1, read_only=True
    )
    light: float = parameter(1.0, "brightness of the room", minimum=0.05, maximum=3.0, read_only=True)
    extra_cubes: int = parameter(
        0,
        "further Rubik's cubes in the room, other than the target",
        minimum=0,
        maximum=_MOST_EXTRA_CUBES,
        read_only=True,
    )
    look_alikes: int = parameter(
        0,
        "things in the room that are coloured or chequered like a Rubik's cube",
        minimum=0,
        maximum=_MOST_LOOK_ALIKES,
        read_only=True,
    )
    distractor: str = parameter(
        "four",
        "what is put at sim/distractor_pose, 6 cm wide, in the cube's colours: a puzzle of so many cells a side, a "
        "die, a plain or a striped block",
        choices=DISTRACTORS,
        read_only=True,
    )
    samples: int = parameter(0, "samples a pixel when rendering", minimum=0, maximum=16, read_only=True)

    frame_rate_hz: float = parameter(30.0, "of each camera", unit="Hz", minimum=1, maximum=120, read_only=True)
    right_clock_offset_s: float = parameter(
        0.007,
        "the right camera exposes this much after the left one",
        unit="s",
        minimum=-0.5,
        maximum=0.5,
        read_only=True,
    )
    right_clock_drift: float = parameter(
        2e-5, "by how much the right camera's period is longer", minimum=-0.01, maximum=0.01, read_only=True
    )
    frame_jitter_s: float = parameter(
        0.0005, "deviation of exposures from an even beat", unit="s", minimum=0, maximum=0.01
    )
    latency_s: float = parameter(0.045, "exposure to publication", unit="s", minimum=0, maximum=1)
    exposure_s: float = parameter(
        0.004, "time of exposure: a turning eye's picture smears; 0 for none", unit="s", minimum=0, maximum=0.1
    )
    noise_sigma: float = parameter(2.5, "sensor noise in grey levels", minimum=0, maximum=50)
    right_gain: float = parameter(1.08, "exposure of the right camera over the left one's", minimum=0.1, maximum=4)
    right_blue_gain: float = parameter(0.95, "white balance: blue of the right over the left", minimum=0.1, maximum=4)
    right_red_gain: float = parameter(1.04, "white balance: red of the right over the left", minimum=0.1, maximum=4)
    jpeg_quality: int = parameter(90, "images pass through JPEG of this quality; 0 for none", minimum=0, maximum=100)

    left_roll_rad: float = parameter(
        -0.003, "the left camera is mounted rolled by", unit="rad", minimum=-0.2, maximum=0.2, read_only=True
    )
    right_roll_rad: float = parameter(
        0.006, "the right camera is mounted rolled by", unit="rad", minimum=-0.2, maximum=0.2, read_only=True
    )
    right_pitch_rad: float = parameter(
        0.0093,
        "the right camera is mounted pitched by (about 5 px)",
        unit="rad",
        minimum=-0.2,
        maximum=0.2,
        read_only=True,
    )
    distortion: tuple[float, ...] = parameter(
        (-0.04, 0.02, 0.0, 0.0, 0.0), "k1 k2 p1 p2 k3 of both lenses", minimum=-1, maximum=1, read_only=True
    )

    target: str = parameter("cube", "which object is the target", choices=TARGETS)
    start_x_m: float = parameter(
        0.8, "the target's place at the start, rig_base", unit="m", minimum=-100, maximum=100, read_only=True
    )
    start_y_m: float = parameter(0.0, "", unit="m", minimum=-100, maximum=100, read_only=True)
    start_z_m: float = parameter(0.0, "", unit="m", minimum=-100, maximum=100, read_only=True)
    target_yaw_rad: float = parameter(
        0.0, "the target is turned about the vertical by", unit="rad", minimum=-3.2, maximum=3.2
    )
    motion: str = parameter("static", "how the target moves about its place", choices=MOTIONS)
    motion_x_m: float = parameter(
        0.0, "amplitude, step or (ramp) speed a second along x", unit="m", minimum=-10, maximum=10
    )
    motion_y_m: float = parameter(0.0, "the same along y", unit="m", minimum=-10, maximum=10)
    motion_z_m: float = parameter(0.0, "the same along z", unit="m", minimum=-10, maximum=10)
    motion_frequency_hz: float = parameter(0.2, "of the sinusoid", unit="Hz", minimum=0.001, maximum=10)
    stations_m: tuple[float, ...] = parameter(
        (0.0, 0.0, 0.0),
        "of motion stations: x y z from its place, of one station after another",
        unit="m",
        minimum=-10,
        maximum=10,
    )
    station_s: float = parameter(2.0, "of motion stations: time at each", unit="s", minimum=0.01, maximum=3600)
    rig_yaw_rate_rad_s: float = parameter(0.0, "the whole rig turns", unit="rad/s", minimum=-5, maximum=5)

    joint_rate_hz: float = parameter(50.0, "of joint_states", unit="Hz", minimum=1, maximum=1000, read_only=True)

    def check(self) -> None:
        """Hold the stations to whole triples."""
        if len(self.stations_m) % 3 or not self.stations_m:
            raise ParameterError("stations_m", self.stations_m, "three numbers, x y z, for every station")

    @classmethod
    def ideal(cls, **changes: object) -> "SimParameters":
        """Return the set without any imperfection."""
        return cls(preset="ideal", **changes).effective()  # type: ignore[arg-type]

    def effective(self) -> "SimParameters":
        """Return the set with the preset applied."""
        if self.preset != "ideal":
            return self
        return self.replaced(
            servo="ideal",
            right_clock_offset_s=0.0,
            right_clock_drift=0.0,
            frame_jitter_s=0.0,
            exposure_s=0.0,
            noise_sigma=0.0,
            right_gain=1.0,
            right_blue_gain=1.0,
            right_red_gain=1.0,
            jpeg_quality=0,
            left_roll_rad=0.0,
            right_roll_rad=0.0,
            right_pitch_rad=0.0,
            distortion=(0.0, 0.0, 0.0, 0.0, 0.0),
        )


GROUPS: Groups = (("", SimParameters),)
