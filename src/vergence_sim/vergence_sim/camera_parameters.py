"""Parameters of the simulated cameras: what both have in common, how the right one differs. Lenses are the head's."""

from dataclasses import dataclass

from vergence_rig.parameters import Parameters, parameter


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


@dataclass(frozen=True)
class RightCameraParameters(Parameters):
    """How the right camera differs from the left one."""

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
