"""The whole graph as processes with the shipped YAML: a click, and both eyes are on the target."""

import subprocess
import sys
from pathlib import Path

import pytest

from vergence_sim.renderer import RenderError
from vergence_sim.simulator import Simulator

pytestmark = pytest.mark.system


@pytest.fixture(autouse=True)
def opengl() -> None:
    try:
        Simulator().close()
    except RenderError as error:
        pytest.skip(f"no OpenGL here: {error}")


@pytest.mark.timeout(180)
def test_a_station_verges_and_leaves_its_report(domain_id: int, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "vergence_bringup.command_line", "demo", "--station", "cube_right_up"]
    result = subprocess.run(
        [*command, "--out", str(tmp_path)], capture_output=True, text=True, timeout=170, check=False
    )
    assert result.returncode == 0, result.stdout + result.stderr
    assert "1 of 1 stations verged" in result.stdout
    report = (tmp_path / "report.html").read_text()
    assert report.count("data:image/") == 10
    assert (tmp_path / "summary.json").stat().st_size > 500
    for log in (tmp_path / "log").iterdir():
        assert "Traceback" not in log.read_text(), log.name
