"""Latencies that are parameters of nodes: a camera's stamp offset, a servo driver's modelled latency."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from vergence_calibration.identification.axis_log import EYES
from vergence_calibration.identification.latencies import Estimate, Latencies

_SIGNIFICANT = 3.0
_LEAST_S = 0.002
_LONGEST_S = 1.0


@dataclass(frozen=True)
class Owner:
    """A node with such a parameter, and the parameter's value [s]."""

    name: str
    value_s: float


@dataclass(frozen=True)
class Owners:
    """The cameras' nodes by eye, and the one that drives the servos; nodes without the parameter are left out."""

    cameras: Mapping[str, Owner]
    servos: Owner | None


def node_parameters(latencies: Latencies, owners: Owners) -> dict[str, Any]:
    """Return a ROS parameter document by node with the changes; empty for none.

    The image stamps are moved back by their lateness, and the driver's modelled latency is corrected by the mean
    lateness of its joint_states.
    """
    document: dict[str, Any] = {}
    for eye in EYES:
        late = latencies.stamp_late_s[eye]
        if eye in owners.cameras and _counts(late):
            camera = owners.cameras[eye]
            document[camera.name] = _of_node("stamp_offset_s", _limited(camera.value_s + late.value_s, -_LONGEST_S))
    known = [late for late in latencies.joints_late_s.values() if late.known]
    if owners.servos is not None and known:
        mean = Estimate(
            sum(late.value_s for late in known) / len(known), sum(late.sigma_s**2 for late in known) ** 0.5 / len(known)
        )
        if _counts(mean):
            document[owners.servos.name] = _of_node(
                "command_latency_s", _limited(owners.servos.value_s - mean.value_s, 0.0)
            )
    return document


def _counts(estimate: Estimate) -> bool:
    return estimate.known and abs(estimate.value_s) > max(_SIGNIFICANT * estimate.sigma_s, _LEAST_S)


def _limited(value_s: float, least_s: float) -> float:
    return round(min(max(value_s, least_s), _LONGEST_S), 4)


def _of_node(parameter: str, value: float) -> dict[str, Any]:
    return {"ros__parameters": {parameter: value}}
