"""Parameters of every node that takes pairs of images."""

from dataclasses import dataclass

from vergence_metric.pairs.parameters import PairingParameters
from vergence_rig.parameters import parameter

TRANSPORTS = ("raw", "compressed")


@dataclass(frozen=True)
class StereoParameters(PairingParameters):
    """Where the images of both eyes come from and how they become pairs."""

    rig: str = parameter("", "path of rig.yaml; empty for the built-in rig", read_only=True)
    image_transport: str = parameter(
        "raw",
        "raw takes left/image_raw and right/image_raw, compressed the JPEGs below them",
        choices=TRANSPORTS,
        read_only=True,
    )
    stalled_after_s: float = parameter(
        1.0, "a stream without an image for this long is reported", unit="s", minimum=0.05, maximum=60.0
    )
    threads: int = parameter(
        1,
        "threads OpenCV may use for one operation; 0 leaves it to OpenCV. More costs other nodes their cores",
        minimum=0,
        maximum=64,
    )
