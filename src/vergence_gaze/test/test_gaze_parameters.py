"""The shipped YAML equals the defaults, and hystereses are held in order."""

from pathlib import Path

import pytest
import yaml

from vergence_gaze.parameters import GazeParameters
from vergence_rig.parameters import ParameterError

YAML = Path(__file__).resolve().parents[3] / "config" / "gaze_controller_node.yaml"


def test_shipped_yaml_equals_the_defaults() -> None:
    shipped = yaml.safe_load(YAML.read_text(encoding="utf-8"))["/**"]["ros__parameters"]
    for name in ("rig", "control_rate_hz"):  # the node's own
        del shipped[name]
    assert GazeParameters.from_mapping(shipped) == GazeParameters()
    assert set(shipped) == {spec.name for spec in GazeParameters.specs()}


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"contrast_leave": 0.1}, "contrast_leave"),
        ({"verged_leave_rad": 0.001}, "verged_leave_rad"),
        ({"law": "magic"}, "predictive"),
    ],
)
def test_wrong_values_are_named(changes: dict[str, object], named: str) -> None:
    with pytest.raises(ParameterError, match=named):
        GazeParameters().replaced(**changes)
