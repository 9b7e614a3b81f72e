"""The control laws, by name."""

from collections.abc import Callable

from vergence_rig.rig import Rig
from vergence_servo.gaze.laws.predictive import PredictiveLaw
from vergence_servo.gaze.laws.protocol import Law, LawView, VisualError
from vergence_servo.gaze.parameters import GazeParameters

_LAWS: dict[str, Callable[[Rig, GazeParameters], Law]] = {"predictive": PredictiveLaw}


def make_law(rig: Rig, parameters: GazeParameters) -> Law:
    """Return the law that the parameters name."""
    return _LAWS[parameters.law](rig, parameters)


__all__ = ["Law", "LawView", "VisualError", "make_law"]
