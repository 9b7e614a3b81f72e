"""`vergence demo --photos`: the whole graph before scikit-image's pair of photographs, one click."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.system


@pytest.mark.timeout(420)
def test_the_demo_clicks_on_a_photograph_and_verges(tmp_path: Path) -> None:
    try:
        from skimage.data import stereo_motorcycle

        stereo_motorcycle()
    except (ImportError, OSError) as error:
        pytest.skip(f"scikit-image's stereo pair is not here: {error}")
    command = [sys.executable, "-m", "vergence_bringup.command_line", "demo", "--photos"]
    command += ["--station", "point_2", "--out", str(tmp_path)]
    for _ in range(3):  # the graph runs in real time on whatever cores are free
        result = subprocess.run(command, capture_output=True, text=True, timeout=130, check=False)
        if result.returncode == 0:
            break
    assert result.returncode == 0, result.stdout + result.stderr
    assert "1 of 1 stations verged" in result.stdout
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["photographs"]["disparities_from"] == "structured light"
    (station,) = summary["stations"]
    assert (station["result"], station["truth_agrees"]) == ("VERGED", True)
    photo = station["photo"]
    assert photo["verged_disparity_px"] == pytest.approx(photo["disparity_px"], abs=8.0)
    report = (tmp_path / "report.html").read_text()
    assert report.count("data:image/") == 13  # the overview, both photographs, five pictures at each moment
    for log in (tmp_path / "log").iterdir():
        assert "Traceback" not in log.read_text(), log.name
