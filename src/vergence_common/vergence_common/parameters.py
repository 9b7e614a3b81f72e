"""Parameter sets of `vergence_rig.parameters` as ROS parameters: declared, validated as a whole, applied together."""

from collections.abc import Callable
from functools import partial
from typing import Any, TypeVar

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.node import Node
from rclpy.parameter import Parameter

from vergence_rig.parameters import (
    Groups,
    ParameterError,
    Parameters,
    ParameterSpec,
    RenamedParameterError,
    UnknownParameterError,
    renamed,
)

ROS_OWN = ("use_sim_time", "start_type_description_service")
ROS_OWN_PREFIXES = ("qos_overrides.",)

Group = TypeVar("Group", bound=Parameters)


class ParameterSet:
    """The current parameter groups of a node. Each group is frozen; a change swaps in new ones, all at once."""

    def __init__(self, groups: dict[str, Parameters]) -> None:
        self._groups = groups
        self._checks: list[Callable[[ParameterSet], None]] = []
        self._listeners: list[Callable[[ParameterSet], None]] = []

    @property
    def value(self) -> Any:
        """The first group declared."""
        return next(iter(self._groups.values()))

    def get(self, kind: type[Group]) -> Group:
        """Return the current group of class `kind`."""
        return next(group for group in self._groups.values() if type(group) is kind)

    def add_check(self, check: Callable[["ParameterSet"], None]) -> None:
        """Call `check` with the set as it would be, types and ranges checked, before each change.

        It raises ParameterError, with the parameter's full name, for what only the node can judge.
        """
        self._checks.append(check)

    def on_change(self, listener: Callable[["ParameterSet"], None]) -> None:
        """Call `listener` with this set after every applied change."""
        self._listeners.append(listener)

    def _candidate(self, changes: dict[str, Any]) -> dict[str, Parameters]:
        fresh = {}
        for prefix, group in self._groups.items():
            own = {spec.name: changes[prefix + spec.name] for spec in group.specs() if prefix + spec.name in changes}
            fresh[prefix] = _named(prefix, partial(group.replaced, **own)) if own else group
        return fresh

    def _writable(self) -> dict[str, ParameterSpec]:
        return {
            prefix + spec.name: spec
            for prefix, group in self._groups.items()
            for spec in group.specs()
            if not spec.read_only
        }

    def _refusal(self, changes: dict[str, Any]) -> str:
        """Return why these changes cannot be made, "" if they can."""
        names = ", ".join(f"'{name}'" for name in changes)
        try:
            candidate = ParameterSet(self._candidate(changes))
            for check in self._checks:
                check(candidate)
        except ParameterError as error:
            return str(error)
        except Exception as error:  # a check that fails must not end the node
            return f"parameter {names} cannot be used: {type(error).__name__}: {error}"
        return ""

    def _apply(self, changes: dict[str, Any]) -> None:
        fresh = self._candidate(changes)
        if any(fresh[prefix] is not group for prefix, group in self._groups.items()):
            self._groups = fresh
            for listener in self._listeners:
                listener(self)


def declare(node: Node, groups: Groups, allow_prefixes: tuple[str, ...] = ()) -> ParameterSet:
    """Declare every parameter of `groups` on `node` and return them validated.

    Args:
        node: the node, whose overrides (command line, YAML) are taken.
        groups: parameter classes with the prefix of their names, such as `("disparity.", DisparityParameters)`.
        allow_prefixes: names with these prefixes are declared elsewhere and not refused as unknown.

    Raises:
        ParameterError: a value of the wrong type or out of range, one that is required and missing, or a name that
            is not declared.
    """
    overrides: dict[str, Parameter] = dict(node._parameter_overrides)
    known = {prefix + spec.name for prefix, group in groups for spec in group.specs()}
    former = renamed(groups)
    for name, override in overrides.items():
        if name in known or name in ROS_OWN or name.startswith(ROS_OWN_PREFIXES + allow_prefixes):
            continue
        if name in former:
            new_name, spec = former[name]
            raise RenamedParameterError(name, override.value, new_name, spec.unit)
        raise UnknownParameterError(name, override.value, known)

    values = {}
    for prefix, group in groups:
        given = {
            spec.name: _from_ros(spec, overrides[prefix + spec.name].value)
            for spec in group.specs()
            if prefix + spec.name in overrides
        }
        values[prefix] = _named(prefix, partial(group.from_mapping, given))
    if len(values) != len(groups):
        raise ValueError("parameter groups must have different prefixes")

    for prefix, instance in values.items():
        for spec in instance.specs():
            value = getattr(instance, spec.name)
            # The override was validated above (a whole number is good for a float); ROS's own check would refuse it.
            node._parameter_overrides[prefix + spec.name] = _to_ros(prefix + spec.name, spec, value)
            descriptor = _descriptor(spec)
            if spec.is_list and not value:
                # rclpy takes an empty list for a byte array and would refuse it: our own validation has to do.
                descriptor.dynamic_typing = True
                node.declare_parameter(prefix + spec.name, list(value), descriptor)
            else:
                node.declare_parameter(prefix + spec.name, _ros_type(spec), descriptor)

    parameter_set = ParameterSet(values)

    def refuse(changes: list[Parameter]) -> SetParametersResult:
        reason = parameter_set._refusal({change.name: change.value for change in changes})
        return SetParametersResult(successful=not reason, reason=reason)

    def apply(changes: list[Parameter]) -> None:
        parameter_set._apply({change.name: change.value for change in changes})

    node.add_on_set_parameters_callback(refuse)
    _refuse_by_name(node, parameter_set)
    node.add_post_set_parameters_callback(apply)
    return parameter_set


def _refuse_by_name(node: Node, parameter_set: ParameterSet) -> None:
    """Check a request before rclpy does: its refusal of a wrong type does not name the parameter.

    A whole number is made a float where one is declared, as at the start.
    """
    of_rclpy = node.set_parameters_atomically

    def set_parameters_atomically(changes: list[Parameter]) -> SetParametersResult:
        writable = parameter_set._writable()
        reason = parameter_set._refusal({c.name: c.value for c in changes if c.name in writable})
        if reason:
            return SetParametersResult(successful=False, reason=reason)
        result = of_rclpy([_typed(change, writable.get(change.name)) for change in changes])
        if not result.successful and not any(change.name in result.reason for change in changes):
            names = ", ".join(f"'{change.name}'" for change in changes)
            result.reason = f"parameter {names} is not changed: {result.reason}"
        return result

    node.set_parameters_atomically = set_parameters_atomically
    for service in node.services:
        if service.srv_type in (SetParameters, SetParametersAtomically):
            service.callback = partial(_answer_odd_types, service.callback)


def _answer_odd_types(answer: Callable[[Any, Any], Any], request: Any, response: Any) -> Any:
    """Refuse values of a type that ROS does not have: rclpy raises, which would end the node."""
    known = {int(kind.value) for kind in Parameter.Type}
    odd = next((parameter for parameter in request.parameters if parameter.value.type not in known), None)
    if odd is None:
        return answer(request, response)
    reason = f"parameter '{odd.name}' must have a type of rcl_interfaces/ParameterType: got {odd.value.type}"
    refused = SetParametersResult(successful=False, reason=reason)
    if isinstance(response, SetParameters.Response):
        response.results = [refused] * len(request.parameters)
    else:
        response.result = refused
    return response


def _typed(change: Parameter, spec: ParameterSpec | None) -> Parameter:
    return change if spec is None else _to_ros(change.name, spec, spec.normalised(change.value))


def _named(prefix: str, build: Callable[[], Any]) -> Any:
    """Run `build`; a ParameterError it raises gets the full name of the parameter."""
    try:
        return build()
    except ParameterError as error:
        raise error.prefixed(prefix) from None


def _ros_type(spec: ParameterSpec) -> Parameter.Type:
    scalar, many = {
        bool: (Parameter.Type.BOOL, Parameter.Type.BOOL_ARRAY),
        int: (Parameter.Type.INTEGER, Parameter.Type.INTEGER_ARRAY),
        float: (Parameter.Type.DOUBLE, Parameter.Type.DOUBLE_ARRAY),
        str: (Parameter.Type.STRING, Parameter.Type.STRING_ARRAY),
    }[spec.kind]
    return many if spec.is_list else scalar


def _to_ros(name: str, spec: ParameterSpec, value: Any) -> Parameter:
    return Parameter(name, _ros_type(spec), list(value) if spec.is_list else value)


def _from_ros(spec: ParameterSpec, value: Any) -> Any:
    # An empty YAML list arrives as a parameter without type or value.
    return () if spec.is_list and value is None else value


def _descriptor(spec: ParameterSpec) -> ParameterDescriptor:
    text = spec.description + (f" [{spec.unit}]" if spec.unit else "")
    descriptor = ParameterDescriptor(description=text, read_only=spec.read_only)
    descriptor.additional_constraints = spec.allowed
    if spec.minimum is None and spec.maximum is None:
        return descriptor
    if spec.kind is int:
        low = -(2**63) if spec.minimum is None else int(spec.minimum)
        high = 2**63 - 1 if spec.maximum is None else int(spec.maximum)
        descriptor.integer_range = [IntegerRange(from_value=low, to_value=high, step=0)]
    elif spec.kind is float:
        lowest = float("-inf") if spec.minimum is None else float(spec.minimum)
        highest = float("inf") if spec.maximum is None else float(spec.maximum)
        descriptor.floating_point_range = [FloatingPointRange(from_value=lowest, to_value=highest, step=0.0)]
    return descriptor
