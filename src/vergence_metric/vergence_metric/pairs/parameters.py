"""Parameters of the pairing of two image streams."""

from dataclasses import dataclass

from vergence_rig.parameters import Parameters, parameter


@dataclass(frozen=True)
class PairingParameters(Parameters):
    """How left and right frames become pairs."""

    pair_slop_s: float = parameter(
        0.02,
        "largest difference of two stamps that still make a pair, inclusive; free-running cameras are up to half a "
        "period apart",
        unit="s",
        minimum=0.0,
        maximum=10.0,
    )
    pair_wait_periods: float = parameter(
        1.0,
        "a pair that a later frame could still better is given out after this many periods of the cameras",
        minimum=0.0,
        maximum=10.0,
    )
    pair_queue: int = parameter(
        16, "frames of one eye that wait for the other eye's, the oldest is dropped first", minimum=2, maximum=1000
    )
