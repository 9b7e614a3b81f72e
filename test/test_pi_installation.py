"""What docs/two_machines.md builds on a Pi is enough for what it types there, without OpenCV, simulator or detector."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from vergence_bringup.node_table import NODES

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs" / "two_machines.md").read_text(encoding="utf-8")
# A finder before all others, which knows nothing of the packages that are not on the Pi.
WITHOUT = """
import sys
absent = set({absent!r})
class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in absent:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name.split(".")[0])
sys.meta_path.insert(0, Absent())
"""


def built() -> set[str]:
    (text,) = re.findall(r"--packages-select (.*?)\n\s+source", PAGE, flags=re.DOTALL)
    return set(text.replace("\\", "").split())


def run(code: str) -> "subprocess.CompletedProcess[str]":
    """Run Python on what is like the Pi: only the packages that the page builds, and what their dependencies are."""
    others = {path.name for path in (ROOT / "src").glob("vergence*")} - built()
    absent = sorted(others | {"cv2", "onnxruntime", "mujoco", "skimage", "scipy"})
    return subprocess.run(
        [sys.executable, "-c", WITHOUT.format(absent=absent) + code], capture_output=True, text=True, timeout=120
    )


def test_the_page_builds_the_servos_the_calibration_and_the_launch_file() -> None:
    assert {"vergence_servo", "vergence_calibration", "vergence_bringup", "vergence_msgs"} <= built()
    assert NODES["edge_metric_node"].package not in built()


@pytest.mark.parametrize(
    "code",
    [
        "import vergence_servo.ros.servo_node",
        "from vergence_calibration.ros.calibrate_servos import main\nsys.argv[1:] = ['--help']\nmain()",
        "from vergence_bringup.command_line import main\nsys.exit(main(['--help']))",
        "from vergence_bringup.command_line import main\nsys.exit(main(['watch', '--once', '0.1']) not in (0, 1))",
        "from vergence_bringup.command_line import main\nsys.exit(main(['look', '--class', 'a', '--wait', '0.1']) - 1)",
    ],
    ids=["servo_node", "calibrate_servos", "vergence", "watch", "look"],
)
def test_what_is_typed_on_the_pi_finds_its_modules(code: str, domain_id: int) -> None:
    ran = run(code)
    assert ran.returncode == 0, ran.stderr
    assert "No module named" not in ran.stderr


def test_the_launch_file_finds_its_modules() -> None:
    pytest.importorskip("launch_ros", reason="launch is not installed here (it comes with ROS from apt)")
    path = ROOT / "src" / "vergence_bringup" / "launch" / "pi.launch.py"
    code = f"import runpy\nrunpy.run_path({str(path)!r})['generate_launch_description']()"
    ran = run(code)
    assert ran.returncode == 0, ran.stderr


def test_the_doctor_says_what_is_there_and_fails_on_nothing_else(domain_id: int) -> None:
    ran = run("from vergence_bringup.command_line import main\nsys.exit(main(['doctor', '--no-render']))")
    assert "Traceback" not in ran.stderr
    assert "nodes:" in ran.stdout
