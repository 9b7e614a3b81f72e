"""Set-up says so, and goes no further, where pip cannot install what it needs; what was tried is tried again."""

import os
import shutil
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def test_packages_that_cannot_be_installed_end_the_setup(tmp_path: Path) -> None:
    (tmp_path / "tools").mkdir()
    shutil.copy(ROOT / "tools" / "bootstrap.sh", tmp_path / "tools")
    shutil.copytree(ROOT / "requirements", tmp_path / "requirements")
    programs = tmp_path / ".venv" / "bin"
    programs.mkdir(parents=True)
    for name, script in (("python", "exit 0"), ("pip", "echo 'ERROR: no such version'; exit 1")):
        (programs / name).write_text(f"#!/bin/sh\n{script}\n", encoding="utf-8")
        (programs / name).chmod(0o755)
    result = subprocess.run(
        ["bash", str(tmp_path / "tools" / "bootstrap.sh"), "run"],
        capture_output=True,
        text=True,
        timeout=60,
        env=os.environ | {"VERGENCE_ROS_SETUP": str(tmp_path / "none.bash")},
    )
    assert result.returncode == 1
    assert "ERROR: no such version" in result.stderr
    assert "pip could not install requirements/ros.txt" in result.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == [".bootstrap.lock", ".venv", "requirements", "tools"]
    assert not list((tmp_path / ".venv").glob(".stamp*"))
