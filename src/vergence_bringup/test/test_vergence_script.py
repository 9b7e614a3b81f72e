"""`vergence` is a plain command in a shell that has sourced install/setup.bash: colcon puts `bin` on the PATH."""

import ast
import os
import subprocess
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[1]
SCRIPT = PACKAGE / "scripts" / "vergence"


def test_setup_py_installs_the_command_into_the_folder_that_colcon_puts_on_the_path():
    assert '("bin", ["scripts/vergence"])' in (PACKAGE / "setup.py").read_text(encoding="utf-8")
    ast.parse((PACKAGE / "setup.py").read_text(encoding="utf-8"))
    assert os.access(SCRIPT, os.X_OK)


@pytest.mark.parametrize("linked", [True, False])
def test_the_command_runs_the_executable_of_its_own_installation(tmp_path, linked):
    """With and without `colcon build --symlink-install`."""
    folder = tmp_path / "a workspace" / "install" / "vergence_bringup"
    (folder / "bin").mkdir(parents=True)
    (folder / "lib" / "vergence_bringup").mkdir(parents=True)
    executable = folder / "lib" / "vergence_bringup" / "vergence"
    executable.write_text('#!/bin/sh\necho "got: $1, $2"\nexit 3\n')
    executable.chmod(0o755)
    if linked:
        (folder / "bin" / "vergence").symlink_to(SCRIPT)
    else:
        (folder / "bin" / "vergence").write_bytes(SCRIPT.read_bytes())
        (folder / "bin" / "vergence").chmod(0o755)
    environment = {"PATH": f"{folder / 'bin'}:{os.environ['PATH']}"}
    command = ["sh", "-c", "vergence doctor 'two words'"]
    ran = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60)
    assert (ran.stdout, ran.returncode) == ("got: doctor, two words\n", 3)
