"""Parameters of any node as values for JSON, and back in their declared types."""

from typing import Any

from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import ParameterDescriptor, ParameterType, ParameterValue
from rclpy.parameter import Parameter, parameter_value_to_python

from vergence_rig.parameters import shown
from vergence_web.page_state import figure
from vergence_web.requests import SetParameter

_KINDS = {
    ParameterType.PARAMETER_BOOL: (bool, False),
    ParameterType.PARAMETER_INTEGER: (int, False),
    ParameterType.PARAMETER_DOUBLE: (float, False),
    ParameterType.PARAMETER_STRING: (str, False),
    ParameterType.PARAMETER_BOOL_ARRAY: (bool, True),
    ParameterType.PARAMETER_INTEGER_ARRAY: (int, True),
    ParameterType.PARAMETER_DOUBLE_ARRAY: (float, True),
    ParameterType.PARAMETER_STRING_ARRAY: (str, True),
}
"""By the type of ROS: the kind of a value, and whether it is a list of them."""
_WORDS = {bool: "true or false", int: "a whole number", float: "a number", str: "a text"}


def entry(descriptor: ParameterDescriptor, value: ParameterValue) -> dict[str, Any]:
    """Return a parameter's description, range and value, as the page lists them."""
    ranges = [*descriptor.floating_point_range, *descriptor.integer_range]
    kind, is_list = _KINDS.get(value.type, (str, True))
    return {
        "name": descriptor.name,
        "description": descriptor.description,
        "allowed": descriptor.additional_constraints,
        "read_only": bool(descriptor.read_only),
        "kind": "list" if is_list else kind.__name__,
        "low": figure(ranges[0].from_value) if ranges else None,
        "high": figure(ranges[0].to_value) if ranges else None,
        "value": plain(value),
    }


def plain(value: ParameterValue) -> Any:
    """Return a parameter's value for JSON; numbers that JSON does not have as texts."""
    return _plain(parameter_value_to_python(value))


def _plain(value: Any) -> Any:
    if isinstance(value, float) and figure(value) is None:
        return str(value)
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    return [_plain(element) for element in value]


def typed(request: SetParameter, declared: ParameterType) -> ParameterMessage:
    """Return a parameter in its declared type: JSON does not tell 1 from 1.0. Raises ValueError for another kind."""
    value = request.value
    if declared == ParameterType.PARAMETER_NOT_SET:  # declared without a type, such as a list without elements
        return Parameter(request.name, value=list(value) if isinstance(value, tuple) else value).to_parameter_msg()
    kind, is_list = _KINDS[declared]
    if is_list != isinstance(value, tuple):
        raise ValueError(f"{request.name} must be {'a list' if is_list else 'one value'}: got {shown(value)}")
    elements = [_cast(request.name, one, kind) for one in (value if isinstance(value, tuple) else (value,))]
    given = elements if is_list else elements[0]
    return Parameter(request.name, Parameter.Type(declared), given).to_parameter_msg()


def _cast(name: str, value: Any, kind: type) -> Any:
    if kind is float and type(value) in (int, float):
        return float(value)
    if kind is int and isinstance(value, float) and value.is_integer():
        return int(value)
    if type(value) is not kind:
        raise ValueError(f"{name} must be {_WORDS[kind]}: got {shown(value)}")
    return value
