"""The table of nodes is the only list: no other file pairs a package with an executable by hand."""

import re
from pathlib import Path

import pytest

from vergence_bringup.commands.doctor import examine
from vergence_bringup.node_table import HOSTS, NODES, PHOTOGRAPHED, REAL, SIMULATED, graph
from vergence_bringup.ros.simulated_head import FRAME_RATE_HZ, LEFT_OUT_IN_REAL_TIME, simulated_head

ROOT = Path(__file__).resolve().parents[3]
SOURCES = ("src", "bench", "test", "tools", "training")
PAIRS = [
    pattern
    for executable, entry in NODES.items()
    for pattern in (
        rf"""["']{entry.package}["'],\s*["']{executable}["']""",
        rf"""package\s*=\s*["']{entry.package}["']""",
    )
]


@pytest.mark.skipif(not (ROOT / "bench").is_dir(), reason="the whole repository is not here")
def test_no_other_file_spells_a_package_and_its_executable():
    spelled = re.compile("|".join(PAIRS))
    files = [path for folder in SOURCES for path in (ROOT / folder).rglob("*.py")]
    assert len(files) > 100
    found = {
        f"{path.relative_to(ROOT)}: {match.group()}"
        for path in files
        if path.name not in ("node_table.py", Path(__file__).name)
        for match in spelled.finditer(path.read_text(encoding="utf-8"))
    }
    assert found == set()


@pytest.mark.parametrize("text", ['("vergence_sim", "sim_node")', "NodeCommand('vergence_sim',\n 'sim_node')"])
def test_a_pair_that_is_spelled_by_hand_is_found(text):
    assert re.search("|".join(PAIRS), text)


def test_every_graph_has_one_source_of_images_and_every_node_behind_it():
    behind = {"edge_metric_node", "box_metric_node", "eye_rotation_node", "gaze_controller_node"}
    assert set(graph(SIMULATED)) == behind | {"sim_node"}
    assert set(graph(PHOTOGRAPHED)) == behind | {"photo_node"}
    assert set(graph(REAL)) == behind | {"camera_node", "servo_node"}


@pytest.mark.parametrize("simulated_time", [False, True])
def test_the_simulated_head_is_the_whole_graph_but_what_is_left_out_in_real_time(simulated_time, tmp_path):
    commands = simulated_head(tmp_path / "rig.yaml", simulated_time=simulated_time, seed=3)
    left_out = () if simulated_time else LEFT_OUT_IN_REAL_TIME
    assert tuple(commands) == tuple(name for name in graph(SIMULATED) if name not in left_out)
    assert set(left_out) < set(graph(SIMULATED))
    for executable, command in commands.items():
        assert (command.package, command.executable) == (NODES[executable].package, executable)
        parameters = command.parameters or {}
        assert parameters["rig"] == str(tmp_path / "rig.yaml")
        assert parameters["use_sim_time"] == simulated_time
    parameters = commands["sim_node"].parameters or {}
    assert (parameters["seed"], parameters["camera.frame_rate_hz"]) == (3, FRAME_RATE_HZ)
    assert parameters["clock.stepped"] == simulated_time
    before = simulated_head(tmp_path / "rig.yaml", PHOTOGRAPHED, simulated_time=simulated_time, left="a.png")
    assert set(before) == set(commands) - {"sim_node"} | {"photo_node"}
    assert (before["photo_node"].parameters or {})["left"] == "a.png"


def test_the_doctor_looks_for_every_node(monkeypatch):
    asked: list[str] = []
    monkeypatch.setattr("vergence_bringup.commands.doctor.find_node", asked.append)
    (finding,) = (finding for finding in examine(render=False) if finding.name == "nodes")
    assert asked == [*NODES, *HOSTS]
    assert finding.message == f"{len(asked)} of {len(asked)} are built"
