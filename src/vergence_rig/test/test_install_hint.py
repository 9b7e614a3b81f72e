"""The hints for packages that apt lacks are commands that the machine's pip accepts."""

import re
import sys
import sysconfig
from pathlib import Path

import pytest

from vergence_rig.install_hint import install_hint

SOURCES = Path(__file__).resolve().parents[2]


@pytest.fixture
def stdlib(tmp_path, monkeypatch):
    """A system's Python whose standard library is in a folder of the test's."""
    monkeypatch.setattr(sysconfig, "get_path", lambda name: str(tmp_path))
    monkeypatch.setattr(sys, "prefix", sys.base_prefix)
    return tmp_path


def test_a_system_that_refuses_pip_gets_the_flag_and_its_reason(stdlib):
    (stdlib / "EXTERNALLY-MANAGED").touch()
    hint = install_hint("mujoco", "onnxruntime")
    assert hint.startswith("python3 -m pip install --user --break-system-packages mujoco onnxruntime (")
    assert "PEP 668" in hint
    assert "virtual environment" in hint


def test_a_system_without_that_rule_needs_no_flag(stdlib):
    assert install_hint("mujoco") == "python3 -m pip install --user mujoco"


def test_a_virtual_environment_needs_no_flag(stdlib, monkeypatch):
    (stdlib / "EXTERNALLY-MANAGED").touch()
    monkeypatch.setattr(sys, "prefix", "/home/me/head/.venv")
    assert install_hint("mujoco") == "python3 -m pip install mujoco"


def test_no_other_text_of_the_packages_says_pip_install():
    bare = re.compile(r"pip3? install")
    files = [path for path in SOURCES.glob("vergence_*/vergence_*/**/*.py") if path.name != "install_hint.py"]
    assert len(files) > 100 or not (SOURCES.parent / "README.md").is_file()
    assert [str(path) for path in files if bare.search(path.read_text(encoding="utf-8"))] == []
