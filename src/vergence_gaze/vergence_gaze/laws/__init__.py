"""The control laws, by name."""

from collections.abc import Callable

from vergence_gaze.laws.metric_descent import MetricDescentLaw
from vergence_gaze.laws.pd_bangbang import PdBangbangLaw
from vergence_gaze.laws.pid_pursuit import PidPursuitLaw
from vergence_gaze.laws.predictive import PredictiveLaw
from vergence_gaze.laws.protocol import Contrast, Law, LawView, VisualError
from vergence_gaze.parameters import GazeParameters
from vergence_rig.rig import Rig

_LAWS: dict[str, Callable[[Rig, GazeParameters], Law]] = {
    law.name: law for law in (PredictiveLaw, PdBangbangLaw, PidPursuitLaw, MetricDescentLaw)
}


def make_law(rig: Rig, parameters: GazeParameters) -> Law:
    """Return the law that the parameters name."""
    return _LAWS[parameters.law](rig, parameters)


__all__ = ["Contrast", "Law", "LawView", "VisualError", "make_law"]
