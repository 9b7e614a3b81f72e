"""`vergence doctor` and the errors of missing nodes give the remedy of the kind of machine: apt's ROS or the wheels."""

import importlib.util
import sys

import pytest

from vergence_bringup import machine
from vergence_bringup.commands import doctor
from vergence_bringup.graph_errors import ProcessError
from vergence_bringup.ros.processes import find_executable


@pytest.fixture(params=["apt", "wheels"])
def kind(request, tmp_path, monkeypatch):
    folder = tmp_path / "jazzy"
    if request.param == "apt":
        folder.mkdir()
        monkeypatch.delenv("VERGENCE_CONFIG_DIR", raising=False)
    monkeypatch.setattr(machine, "APT_ROS", folder)
    monkeypatch.delenv("FASTRTPS_DEFAULT_PROFILES_FILE", raising=False)
    return request.param


@pytest.fixture
def nothing_is_installed(monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    monkeypatch.setattr(doctor, "NODES", {"absent_node": None})
    monkeypatch.setattr(doctor, "find_node", lambda name: find_executable("vergence_absent", name))


def test_every_remedy_is_of_this_kind_of_machine(kind, nothing_is_installed):
    findings = [finding for finding in doctor.examine(render=False) if not finding.ok]
    remedies = "\n".join(finding.remedy + finding.message for finding in findings)
    assert {"rclpy", "nodes", "DDS profile", "detector", "simulator"} <= {finding.name for finding in findings}
    assert ("source env.sh" in remedies) == (kind == "wheels")
    assert ("source install/setup.bash" in remedies) == (kind == "apt")
    assert ("sudo apt install python3-opencv" in remedies) == (kind == "apt")


def test_what_only_some_heads_need_is_a_note(kind, nothing_is_installed):
    needed = {finding.name for finding in doctor.examine(render=False) if finding.needed}
    assert "detector" not in needed
    assert ("simulator" in needed) == (kind == "wheels")


def test_a_node_that_is_not_built_names_the_command_of_this_kind_of_machine(kind):
    with pytest.raises(ProcessError, match=r"env\.sh" if kind == "wheels" else r"install/setup\.bash"):
        find_executable("vergence_absent", "absent_node")


def test_pip_remedies_are_commands_that_this_python_accepts(monkeypatch, nothing_is_installed):
    monkeypatch.setattr("vergence_rig.install_hint.externally_managed", lambda: True)
    monkeypatch.setattr(sys, "prefix", sys.base_prefix)
    remedies = {finding.name: finding.remedy for finding in doctor.examine(render=False)}
    for name, package in (("detector", "onnxruntime"), ("simulator", "mujoco"), ("recordings", "rosbags")):
        assert f"pip install --user --break-system-packages {package}" in remedies[name]
