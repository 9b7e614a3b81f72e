"""The actions of control_msgs on machines without that package: its interfaces are built for the test."""

import importlib.util
import re
import subprocess
import sys
from pathlib import Path

import pytest

from .control_messages import environment_with_control_msgs

pytestmark = [pytest.mark.system, pytest.mark.timeout(600)]

TESTS = Path(__file__).resolve().parents[1] / "graph" / "test_standard_actions.py"


@pytest.mark.skipif(
    importlib.util.find_spec("control_msgs") is not None, reason="the graph tests run with it themselves"
)
def test_the_graph_tests_of_the_standard_actions_pass() -> None:
    environment = environment_with_control_msgs()
    command = [sys.executable, "-m", "pytest", str(TESTS)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=550)
    assert done.returncode == 0, done.stdout[-6000:] + done.stderr[-2000:]
    assert re.search(r"\d+ passed", done.stdout)
    assert "skipped" not in done.stdout
