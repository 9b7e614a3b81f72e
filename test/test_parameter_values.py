"""Every declared parameter with odd values of every type: taken, or refused with the parameter's name."""

from typing import Any

import pytest

from vergence_bringup.node_table import NODES, parameter_groups
from vergence_rig.parameters import ParameterError, Parameters, ParameterSpec
from vergence_rig.testing.odd_values import ODD_VALUES


def _required(group: type[Parameters]) -> dict[str, Any]:
    return {spec.name: {str: "given", int: 0, float: 0.0}[spec.kind] for spec in group.specs() if spec.required}


def _limits(spec: ParameterSpec) -> list[object]:
    """Return the limits of a number, and what lies just beyond them, as scalar and as list."""
    ends = [limit for limit in (spec.minimum, spec.maximum) if limit is not None]
    numbers = [end + step for end in ends for step in (-1e-3, 0.0, 1e-3)]
    whole = [int(end) + step for end in ends for step in (-1, 0, 1)]
    return [*numbers, *whole, *([number] for number in numbers), *([number] for number in whole)]


def _made(group: type[Parameters], spec: ParameterSpec, value: object) -> Parameters | ParameterError:
    try:
        return group.from_mapping({**_required(group), spec.name: value})
    except ParameterError as error:
        return error


@pytest.mark.parametrize("executable", sorted(NODES))
def test_every_value_is_taken_or_refused_by_name(executable: str) -> None:
    for prefix, group in parameter_groups(executable):
        for spec in group.specs():
            for value in (*ODD_VALUES, *_limits(spec)):
                made = _made(group, spec, value)
                if isinstance(made, ParameterError):
                    text = str(made.prefixed(prefix))
                    assert f"parameter '{prefix}{made.name}'" in text, (spec.name, value)
                    assert len(text) < 2000, f"{prefix}{spec.name}: {len(text)} characters for {str(value)[:40]}"
                else:
                    taken = getattr(made, spec.name)
                    elements = taken if spec.is_list else (taken,)
                    assert all(type(element) is spec.kind for element in elements), (prefix, spec.name, value)
