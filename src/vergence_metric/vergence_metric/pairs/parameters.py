"""Parameters of the nodes that measure pairs of images: where the images come from, and how they are paired."""

from dataclasses import dataclass

from vergence_rig.parameters import Parameters, parameter

TRANSPORTS = ("raw", "compressed")


@dataclass(frozen=True)
class StereoParameters(Parameters):
    """Where the images of both eyes come from; the root group of each of these nodes."""

    rig: str = parameter("", "path of rig.yaml; empty for the built-in rig", read_only=True)
    image_transport: str = parameter(
        "raw",
        "`raw` subscribes left/image_raw and right/image_raw, `compressed` the JPEG topics below them",
        choices=TRANSPORTS,
        read_only=True,
    )
    stalled_after_s: float = parameter(
        1.0,
        "time without an image after which diagnostics report a stream as stalled",
        unit="s",
        minimum=0.05,
        maximum=60.0,
    )
    threads: int = parameter(
        1,
        "number of threads that OpenCV and BLAS may use for one operation; 0 is one for each core. More threads take "
        "cores from other nodes",
        minimum=0,
        maximum=64,
    )


@dataclass(frozen=True)
class PairingParameters(Parameters):
    """How left and right frames become pairs; the group `pair.`."""

    slop_s: float = parameter(
        0.035,
        "largest difference of the two stamps of a pair, inclusive; free-running cameras differ by up to half a period,"
        " and webcams halve their rate in dim light: this is enough for 15 Hz",
        unit="s",
        minimum=0.0,
        maximum=10.0,
        formerly="pair_slop_s",
    )
    wait_periods: float = parameter(
        1.0,
        "number of camera periods after which a pair is released although a later frame could match better",
        minimum=0.0,
        maximum=10.0,
        formerly="pair_wait_periods",
    )
    queue: int = parameter(
        16,
        "number of frames of one eye that may wait for the other eye's; the oldest is dropped first",
        minimum=2,
        maximum=1000,
        formerly="pair_queue",
    )
