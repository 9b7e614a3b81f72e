"""Parameters by full name: shipped YAML, hystereses in order, names and values checked, former names."""

from pathlib import Path

import pytest
import yaml

from vergence_gaze.law_registry import law_groups, law_names
from vergence_gaze.parameter_groups import GROUPS, gaze_parameters
from vergence_gaze.target_parameters import TargetParameters
from vergence_rig.parameters import ParameterError, renamed

YAML = Path(__file__).resolve().parents[3] / "config" / "gaze_controller_node.yaml"


def test_shipped_yaml_equals_the_defaults() -> None:
    shipped = yaml.safe_load(YAML.read_text(encoding="utf-8"))["/**"]["ros__parameters"]
    flat: dict[str, object] = {}
    for name, value in shipped.items():
        inner = value if isinstance(value, dict) else {"": value}
        flat |= {f"{name}.{leaf}".rstrip("."): setting for leaf, setting in inner.items()}
    assert gaze_parameters(flat) == gaze_parameters()
    assert set(flat) == {prefix + spec.name for prefix, kind in GROUPS for spec in kind.specs()}


@pytest.mark.parametrize(
    ("values", "named"),
    [
        ({"verged.contrast_leave": 0.1}, "'verged.contrast_leave'.*verged.contrast_enter"),
        ({"verged.leave_rad": 0.001}, "'verged.leave_rad'.*verged.direction_rad"),
        ({"law": "magic"}, "predictive"),
        ({"pid_pursuit.kp": (1.0, 2.0)}, "'pid_pursuit.kp'.*three"),
        ({"verged_enter_rad": 0.01}, "verged_enter_rad"),
    ],
)
def test_wrong_values_are_named(values: dict[str, object], named: str) -> None:
    with pytest.raises(ParameterError, match=named):
        gaze_parameters(values)


def test_values_reach_their_group() -> None:
    parameters = gaze_parameters({"target.gate_sigma": 5.0, "mode": "left_held"})
    assert parameters.target == TargetParameters(gate_sigma=5.0)
    assert parameters.control.mode == "left_held"
    assert parameters.search == gaze_parameters().search


def test_every_law_has_parameters_under_its_name() -> None:
    groups = dict(GROUPS)
    assert {prefix for prefix, _ in law_groups()} == {f"{name}." for name in law_names()}
    assert all(groups[prefix] is kind and kind.specs() for prefix, kind in law_groups())


def test_former_names_lead_to_the_new_ones() -> None:
    former = renamed(GROUPS)
    assert former["verged_doubt"][0] == "verged.single_pair_error_probability"
    assert former["saccade_threshold_rad"][0] == "saccade.threshold_rad"
    assert not set(former) & {prefix + spec.name for prefix, kind in GROUPS for spec in kind.specs()}
