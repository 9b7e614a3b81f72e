"""The Foxglove layout: its panels are all placed, and show topics and fields that the graph and its recordings have."""

import importlib
import json
import re
from pathlib import Path

import pytest

from vergence.bags.topics import TOPICS

ROOT = Path(__file__).resolve().parents[3]
LAYOUT = json.loads((ROOT / "config" / "foxglove.json").read_text(encoding="utf-8"))
PANELS = LAYOUT["configById"]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def placed(node):
    return {node} if isinstance(node, str) else placed(node["first"]) | placed(node["second"])


def paths():
    """Return the message paths of all plots and state transitions."""
    return [path["value"] for panel in PANELS.values() for path in panel.get("paths", [])]


def split(path):
    topic, _, field = path.partition(".")
    return topic.lstrip("/"), field


def test_every_panel_has_a_place_and_every_place_a_panel():
    assert placed(LAYOUT["layout"]) == set(PANELS)


@pytest.mark.parametrize("path", paths())
def test_a_plotted_field_is_recorded_and_exists(path):
    topic, field = split(path)
    package, _, name = TOPICS[topic].split("/")
    kind = getattr(importlib.import_module(f"{package}.msg"), name)
    parts = re.fullmatch(r"(\w+)(\[\d\])?", field)
    assert parts is not None
    name, index = parts.groups()
    declared = kind.get_fields_and_field_types()[name]
    assert ("sequence" in declared) == (index is not None)


def test_everything_of_the_graph_is_shown():
    shown = {split(path)[0] for path in paths()} | {split(PANELS["RawMessages!state"]["topicPath"])[0]}
    shown |= {panel["imageMode"]["imageTopic"].lstrip("/") for panel in PANELS.values() if panel.get("imageMode")}
    shown |= {topic.lstrip("/") for topic in PANELS["3D!head"]["topics"]} | {"diagnostics"}
    assert {topic for topic in shown if topic not in TOPICS} <= {
        *("vergence/overlay", "vergence/box_overlay", "vergence/target_point"),
        *("gaze/markers", "robot_description", "diagnostics"),
    }
    for topic in ("vergence/overlay", "vergence/box_overlay", "vergence/target_point", "gaze/markers"):
        assert f"`{topic}`" in README
    assert {"left/image_raw/compressed", "vergence/edge", "vergence/error", "vergence/track", "vergence/box"} <= shown
    assert {"gaze/state", "gaze/goal", "gaze/fixation_point", "joint_states", "joint_command"} <= shown


def test_a_click_in_space_is_a_target():
    assert PANELS["3D!head"]["publish"] == {"type": "point", "pointTopic": "/gaze/target"}
