"""The head of the closed-loop benchmarks, and the rig that metric and controller are given of it."""

from vergence_rig.rig import Rig
from vergence_sim.heads import HeadParameters, simulated_head


def simulated(rig: Rig) -> Rig:
    """Return the default simulated head, with the servos and joint limits of `rig`."""
    return simulated_head(HeadParameters(), rig)


def described(rig: Rig) -> Rig:
    """Return what the graph is given: a printed head is identified, another one is taken to be `rig`."""
    return simulated(rig) if HeadParameters().model == "printed" else rig
