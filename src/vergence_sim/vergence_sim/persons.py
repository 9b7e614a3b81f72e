"""Boards with portraits that stand for persons: where they are, and how they sway or cross."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vergence_rig.parameters import Parameters, parameter

Array = npt.NDArray[np.float64]

PERSONS = ("person1", "person2", "person3")
PERSON_CLASS = "person"
BOARD_HALF_M = (0.006, 0.11, 0.15)
"""Half the depth, width and height of a board [m]."""
PERSON_MOTIONS = ("static", "sway", "cross")

_OWN_PACE = 0.2  # by how much each sways faster than the one before
_PHASE_RAD = 2.0  # by how much each is ahead of the one before


@dataclass(frozen=True)
class PersonParameters(Parameters):
    """Boards of 22 by 30 cm with portraits, side by side before the head; a changed place or motion begins anew."""

    count: int = parameter(0, "number of persons before the head", minimum=0, maximum=len(PERSONS), read_only=True)
    motion: str = parameter(
        "static",
        "motion of the persons: static for none, sway for each about its place, cross for places that are changed with "
        "the opposite one again and again",
        choices=PERSON_MOTIONS,
    )
    x_m: float = parameter(1.0, "x of the first person, the rightmost, in rig_base", unit="m", minimum=0.2, maximum=10)
    step_m: float = parameter(
        0.3, "by how much each person is farther away than the one before", unit="m", minimum=-2, maximum=2
    )
    spacing_m: float = parameter(
        0.45, "distance of the persons from one another along y", unit="m", minimum=0, maximum=5
    )
    z_m: float = parameter(0.0, "z of the persons' middle in rig_base", unit="m", minimum=-2, maximum=2)
    amplitude_m: float = parameter(
        0.12, "how far a person sways to each side, and a third as far forth and back", unit="m", minimum=0, maximum=2
    )
    frequency_hz: float = parameter(0.15, "frequency of the first person's motion", unit="Hz", minimum=0.001, maximum=5)


def person_place_m(parameters: PersonParameters, number: int, time_s: float) -> Array:
    """Return where person `number`, from 0, is (3,) in rig_base [m], `time_s` after the motion began."""
    p = parameters
    aside_m = p.spacing_m * (number - 0.5 * (p.count - 1))
    place = np.array([p.x_m + p.step_m * number, aside_m, p.z_m])
    turn = 2.0 * math.pi * p.frequency_hz * time_s
    if p.motion == "sway":
        turn = turn * (1.0 + _OWN_PACE * number) + _PHASE_RAD * number
        place[:2] += p.amplitude_m / 3.0 * math.cos(turn), p.amplitude_m * math.sin(turn)
    elif p.motion == "cross":
        place[1] = aside_m * math.cos(turn)
    return place
