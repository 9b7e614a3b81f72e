"""Every config/<executable>.yaml says what a bare `ros2 run` does: its values equal the declared defaults."""

from pathlib import Path
from typing import Any

import pytest
import yaml

from vergence_bringup.node_table import NODES, parameter_groups
from vergence_rig.parameters import ParameterSpec

CONFIG = Path(__file__).resolve().parents[2] / "config"

NOT_EXECUTABLES = {"diagnostics", "rig", "servos"}


def specs_of(executable: str) -> dict[str, ParameterSpec]:
    return {prefix + spec.name: spec for prefix, group in parameter_groups(executable) for spec in group.specs()}


def shipped(executable: str) -> dict[str, Any]:
    document = yaml.safe_load((CONFIG / f"{executable}.yaml").read_text())
    assert list(document) == ["/**"]
    assert list(document["/**"]) == ["ros__parameters"]
    values: dict[str, Any] = document["/**"]["ros__parameters"] or {}
    return values


def flattened(values: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for name, value in values.items():
        flat |= flattened(value, f"{prefix}{name}.") if isinstance(value, dict) else {prefix + name: value}
    return flat


def test_every_yaml_is_an_executables_and_the_other_way_round() -> None:
    assert {path.stem for path in CONFIG.glob("*.yaml")} - NOT_EXECUTABLES == set(NODES)


@pytest.mark.parametrize("executable", sorted(NODES))
def test_values_equal_the_defaults(executable: str) -> None:
    specs = specs_of(executable)
    expected = {n: list(s.default) if s.is_list else s.default for n, s in specs.items() if not s.required}
    found = flattened(shipped(executable))
    assert found == expected
    assert {name: type(value) for name, value in found.items()} == {n: type(v) for n, v in expected.items()}


@pytest.mark.parametrize("executable", sorted(NODES))
def test_required_ones_are_shown_but_left_to_the_user(executable: str) -> None:
    text = (CONFIG / f"{executable}.yaml").read_text()
    for name, spec in specs_of(executable).items():
        if spec.required:
            assert f"# {name}:" in text


def test_every_nodes_diagnostics_are_in_one_group_of_the_aggregators() -> None:
    document = yaml.safe_load((CONFIG / "diagnostics.yaml").read_text())
    groups = [group for group in document["/**"]["ros__parameters"].values() if isinstance(group, dict)]
    assert {group["type"] for group in groups} == {"diagnostic_aggregator/GenericAnalyzer"}
    for executable in NODES:
        for name in (f"{executable}: qos", f"head/left/{executable}: qos"):
            matching = [group["path"] for group in groups if any(text in name for text in group["contains"])]
            assert len(matching) == 1, (name, matching)


def test_the_camera_reports_the_skew_at_which_pairs_are_refused() -> None:
    slop = {shipped(name)["pair"]["slop_s"] for name in ("edge_metric_node", "box_metric_node")}
    assert slop == {shipped("camera_node")["max_skew_s"]}
