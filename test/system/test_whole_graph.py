"""The whole graph as processes with the shipped YAML: a click or a class, and both eyes are on it."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = [pytest.mark.system, pytest.mark.usefixtures("opengl")]


@pytest.mark.timeout(600)
def test_a_click_and_a_class_end_on_the_target_and_leave_their_report(domain_id: int, tmp_path: Path) -> None:
    stations = ["cube_right_up", "cube_distractor"]
    command = [sys.executable, "-m", "vergence_bringup.command_line", "demo", "--out", str(tmp_path)]
    for name in stations:
        command += ["--station", name]
    result = subprocess.run(command, capture_output=True, text=True, timeout=540, check=False)
    assert result.returncode == 0, result.stdout + result.stderr
    assert "2 of 2 stations verged" in result.stdout
    assert "of simulated time" in result.stdout
    report = (tmp_path / "report.html").read_text()
    assert report.count("data:image/") == 21  # the overview, and ten pictures of each station
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert [station["name"] for station in summary["stations"]] == stations
    assert 0.0 < summary["real_time_factor"] <= 1.1
    # Metric II of the very pair that metric I is of; the nearer look-alike is not the cube.
    for station in summary["stations"]:
        assert station["left_to_right_px"]["start"]
        assert station["box"]["start"]["status"]
    for log in (tmp_path / "log").iterdir():
        assert "Traceback" not in log.read_text(), log.name
