"""Disparity estimators by name. `register_estimator` adds one; the parameter `disparity.estimator` chooses one.

This module imports no parameters, because the parameters take the allowed names from here.
"""

from collections.abc import Callable

from vergence_metric.disparity.protocol import DisparityEstimator

EstimatorBuilder = Callable[..., DisparityEstimator]
"""Called with the DisparityParameters; returns an estimator. The class of an estimator is one."""

_BUILDERS: dict[str, EstimatorBuilder] = {}


def register_estimator(name: str, build: EstimatorBuilder) -> None:
    """Add an estimator under a name that is free; raises ValueError for one in use."""
    if name in _BUILDERS:
        raise ValueError(f"the name of a disparity estimator must be new: got {name!r}, which is registered")
    _BUILDERS[name] = build


def estimator_names() -> tuple[str, ...]:
    """Return the names of all registered estimators, in order of registration."""
    return tuple(_BUILDERS)


def estimator_builder(name: str) -> EstimatorBuilder:
    """Return the builder of an estimator; raises KeyError for a name that is not registered."""
    return _BUILDERS[name]
