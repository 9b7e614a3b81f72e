"""Parameters of the simulated cameras: what both have in common, and how the right one differs."""

from dataclasses import dataclass

from vergence_rig.camera_limits import COEFFICIENTS
from vergence_rig.parameters import ParameterError, Parameters, parameter


@dataclass(frozen=True)
class CameraParameters(Parameters):
    """What both cameras have in common."""

    frame_rate_hz: float = parameter(
        30.0, "frame rate of each camera", unit="Hz", minimum=1, maximum=120, read_only=True, formerly="frame_rate_hz"
    )
    frame_jitter_s: float = parameter(
        0.0005,
        "standard deviation of an exposure's time from an even beat",
        unit="s",
        minimum=0,
        maximum=0.01,
        formerly="frame_jitter_s",
    )
    latency_s: float = parameter(
        0.045, "time from an exposure to its publication", unit="s", minimum=0, maximum=1, formerly="latency_s"
    )
    exposure_s: float = parameter(
        0.004,
        "exposure time, during which the picture of a turning eye is blurred; 0 for no blur",
        unit="s",
        minimum=0,
        maximum=0.1,
        formerly="exposure_s",
    )
    noise_sigma: float = parameter(
        2.5,
        "standard deviation of the sensor noise",
        unit="grey levels",
        minimum=0,
        maximum=50,
        formerly="noise_sigma",
    )
    jpeg_quality: int = parameter(
        90,
        "quality of the JPEG that every image is compressed to and decoded from; 0 for no JPEG",
        minimum=0,
        maximum=100,
        formerly="jpeg_quality",
    )
    distortion: tuple[float, ...] = parameter(
        (-0.04, 0.02, 0.0, 0.0, 0.0),
        "distortion coefficients of both lenses in OpenCV's order, k1 k2 p1 p2 k3 ...",
        minimum=-1,
        maximum=1,
        read_only=True,
        formerly="distortion",
    )

    def check(self) -> None:
        """See Parameters."""
        counts = COEFFICIENTS["plumb_bob"]
        if len(self.distortion) not in counts:
            raise ParameterError("distortion", self.distortion, f"a list of {', '.join(map(str, counts))} numbers")


@dataclass(frozen=True)
class LeftCameraParameters(Parameters):
    """How the left camera is mounted."""

    roll_rad: float = parameter(
        -0.003,
        "roll of the left camera in its mount",
        unit="rad",
        minimum=-0.2,
        maximum=0.2,
        read_only=True,
        formerly="left_roll_rad",
    )


@dataclass(frozen=True)
class RightCameraParameters(Parameters):
    """How the right camera differs from the left one, and how it is mounted."""

    clock_offset_s: float = parameter(
        0.007,
        "time by which the right camera exposes after the left one",
        unit="s",
        minimum=-0.5,
        maximum=0.5,
        read_only=True,
        formerly="right_clock_offset_s",
    )
    clock_drift: float = parameter(
        2e-5,
        "share by which the right camera's period is longer than the left one's",
        minimum=-0.01,
        maximum=0.01,
        read_only=True,
        formerly="right_clock_drift",
    )
    gain: float = parameter(
        1.08,
        "exposure of the right camera, as a multiple of the left one's",
        minimum=0.1,
        maximum=4,
        formerly="right_gain",
    )
    blue_gain: float = parameter(
        0.95,
        "white balance: blue channel of the right camera, as a multiple of the left one's",
        minimum=0.1,
        maximum=4,
        formerly="right_blue_gain",
    )
    red_gain: float = parameter(
        1.04,
        "white balance: red channel of the right camera, as a multiple of the left one's",
        minimum=0.1,
        maximum=4,
        formerly="right_red_gain",
    )
    roll_rad: float = parameter(
        0.006,
        "roll of the right camera in its mount",
        unit="rad",
        minimum=-0.2,
        maximum=0.2,
        read_only=True,
        formerly="right_roll_rad",
    )
    pitch_rad: float = parameter(
        0.0093,
        "pitch of the right camera in its mount (the default shifts its image by about 5 px)",
        unit="rad",
        minimum=-0.2,
        maximum=0.2,
        read_only=True,
        formerly="right_pitch_rad",
    )
