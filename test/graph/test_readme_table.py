"""README's table of nodes has the topics that the nodes really have."""

import importlib
import re
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from rclpy.node import Node

from vergence_bringup.node_table import NODES

from .conftest import Graph

pytestmark = pytest.mark.graph

README = Path(__file__).resolve().parents[2] / "README.md"
ROS_OWN = {"/parameter_events", "/rosout", "/diagnostics"}
WITH_TIME = {"sim_node", "photo_node"}


def rows() -> dict[str, tuple[set[str], set[str], set[str]]]:
    """Return (subscribed, published, services) of each executable in the table."""
    found = {}
    for line in README.read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
        if len(cells) == 4 and re.match(r"`vergence_\w+ \w+`", cells[0]):
            package, executable = cells[0].strip("`").split()
            assert NODES[executable].package == package
            subscribed, published = (set(re.findall(r"`([^`]+)`", cell)) for cell in cells[1:3])
            services = set(re.findall(r"`(~/[^`]+)`", cells[3]))
            found[executable] = (subscribed, published, services)
    return found


def parameters(executable: str, folder: Path) -> dict[str, Any]:
    """Return what a node needs to start here."""
    texture = np.random.default_rng(0).integers(0, 255, (480, 640, 3)).astype(np.uint8)
    for name in ("a.png", "b.png"):
        cv2.imwrite(str(folder / name), texture)
    if executable == "camera_node":
        return {"device": f"{folder}/"}
    pair = {"left": str(folder / "a.png"), "right": str(folder / "b.png")} if executable == "photo_node" else {}
    return pair | ({"use_sim_time": True} if executable in WITH_TIME else {})


def unexplained(names: set[str], patterns: set[str], node: Node) -> tuple[list[str], list[str]]:
    """Return the names that no pattern matches and the patterns that match no name."""
    full = {pattern: f"/{pattern.replace('~', node.get_name())}".replace("//", "/") for pattern in patterns}
    unmatched = [name for name in sorted(names) if not any(fnmatchcase(name, text) for text in full.values())]
    unused = [pattern for pattern, text in full.items() if not any(fnmatchcase(name, text) for name in names)]
    return unmatched, unused


def test_every_node_is_in_the_table() -> None:
    assert rows().keys() == NODES.keys()


@pytest.mark.parametrize("executable", sorted(NODES))
def test_the_table_has_the_topics_of_the_node(
    graph: Graph, executable: str, tmp_path: Path, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROS_HOME", str(tmp_path / "ros"))
    if executable == "sim_node":
        request.getfixturevalue("opengl")
    if executable == "box_metric_node":
        pytest.importorskip("onnxruntime", reason="onnxruntime is not installed here")
    module = importlib.import_module(f"{NODES[executable].package}.ros.{executable}")
    kind = getattr(module, "".join(word.capitalize() for word in executable.split("_")))
    node = graph.start(kind, **parameters(executable, tmp_path))
    subscribed, published, services = rows()[executable]
    topics = {publisher.topic_name for publisher in node.publishers} - ROS_OWN
    assert unexplained(topics, published, node) == ([], [])
    # The node's own list lacks those that no executor attends to.
    received = node.get_subscriber_names_and_types_by_node(node.get_name(), node.get_namespace())
    topics = {topic for topic, _ in received if "/_action/" not in topic} - ROS_OWN
    assert unexplained(topics - {"/clock"}, subscribed, node) == ([], [])
    own = {name for name in (service.service_name for service in node.services) if f"/{executable}/" in name}
    assert {name.replace(f"/{executable}/", "~/") for name in own if "param" not in name} >= services
    offered = {name.replace(f"/{executable}/", "~/") for name in own if "param" not in name and "type_desc" not in name}
    assert offered - services == set()
