"""The control laws that come with the controller; importing this package registers them."""

from vergence_gaze.law_registry import law_class, register_law
from vergence_gaze.laws.metric_descent import MetricDescentLaw
from vergence_gaze.laws.pd_bangbang import PdBangbangLaw
from vergence_gaze.laws.pid_pursuit import PidPursuitLaw
from vergence_gaze.laws.predictive import PredictiveLaw
from vergence_gaze.laws.protocol import Law
from vergence_gaze.parameters import GazeParameters
from vergence_rig.rig import Rig

for _law in (PredictiveLaw, PdBangbangLaw, PidPursuitLaw, MetricDescentLaw):
    register_law(_law)


def make_law(rig: Rig, parameters: GazeParameters) -> Law:
    """Return the law that the parameter `law` names."""
    law: Law = law_class(parameters.control.law)(rig, parameters)
    return law


__all__ = ["make_law"]
