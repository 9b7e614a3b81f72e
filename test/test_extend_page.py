"""The examples of docs/extend.md run as they stand, and what they add can be chosen by name and works.

Each runs in a process of its own: what it registers must not stay in this one.
"""

import re
import subprocess
import sys
from pathlib import Path

import pytest

PAGE = Path(__file__).resolve().parents[1] / "docs" / "extend.md"

USES = {
    "A control law": """
from vergence_gaze.control.controller import GazeController
from vergence_gaze.goals.goal import Goal, GoalKind
from vergence_gaze.parameter_groups import gaze_groups, gaze_parameters
from vergence_gaze.testing.fake_head import TICK_S, FakeHead
from vergence_rig.rig import default_rig
from vergence_rig.servo import IDEAL
assert ("proportional.", ProportionalLaw.Parameters) in gaze_groups()
rig = default_rig().with_servos(IDEAL)
controller = GazeController(rig, gaze_parameters({"law": "proportional", "proportional.gain": 0.3}), 6 * TICK_S)
head, seen = FakeHead(rig, lambda time_s: np.array([0.8, 0.1, 0.05])), []
for tick in range(900):
    seen += head.advance()
    if tick % 6 == 0:
        if tick == 120:
            controller.look_at(Goal(GoalKind.POINT, point_m=(0.8, 0.1, 0.05)), head.time_s)
        command, seen = controller.step(head.time_s, seen), []
        head.execute(command)
assert command.report.law == "proportional" and np.abs(head.true_errors_rad()).max() < 0.005
""",
    "A disparity estimator": """
import numpy as np
from vergence_metric.disparity import make_estimator
from vergence_metric.disparity.parameters import DisparityParameters
texture = cv2.GaussianBlur(np.random.default_rng(0).integers(0, 255, (240, 360)).astype(np.uint8), (0, 0), 1.5)
estimator = make_estimator(DisparityParameters(estimator="block_matching"))
answer = estimator.estimate(texture[:, 20:340], texture[:, 32:352])
assert answer.ok and answer.estimator == "block_matching" and answer.horizontal_px == 12.0, answer
""",
    "A tracker": """
import numpy as np
from vergence_metric.disparity import make_estimator
from vergence_metric.disparity.parameters import DisparityParameters
from vergence_metric.tracking.parameters import TrackerParameters
from vergence_metric.tracking.registry import make_tracker
from vergence_rig.camera import CameraModel
from vergence_rig.geometry import EyeAngles
from vergence_rig.kinematics import Kinematics
from vergence_rig.rig import default_rig
camera = CameraModel(default_rig().left_camera)
parameters = TrackerParameters(kind="fixed_template")
tracker = make_tracker(parameters, make_estimator(DisparityParameters()), camera, Kinematics(default_rig()))
texture = cv2.GaussianBlur(np.random.default_rng(0).integers(0, 255, (520, 720)).astype(np.uint8), (0, 0), 2.5)
eyes = EyeAngles(0.0, 0.0, 0.0)
first = tracker.update(texture[20:500, 30:670], texture[20:500, 38:678], 1.0, eyes)
moved = tracker.update(texture[25:505, 40:680], texture[25:505, 48:688], 1.1, eyes)
shift = np.subtract(moved.left_px, first.left_px)
assert isinstance(tracker, FixedTemplate) and np.allclose(shift, (-10.0, -5.0))
""",
    "A servo driver": """
from vergence_servo.drivers.registry import open_driver
from vergence_servo.parameters import GROUPS, ServoNodeParameters
assert ServoNodeParameters(backend="log").backend == "log" and ("log.", LogParameters) in GROUPS
driver = open_driver("log", {"channels": 2})
assert driver.set_pulse_us(1, 1500.4) == 1500.0
driver.release(1)
assert driver.lines == [(1, 1500.0), (1, None)]
""",
    "A camera source": """
from vergence_camera.source_choice import SourceOptions, make_source
source = make_source("pattern://", SourceOptions())
mode, frame = source.open(), source.read(1.0)
assert (mode.width_px, frame.sequence, frame.data.shape) == (320, 1, (240, 320))
""",
    "A detector layout": """
from vergence_metric.boxes.layouts import WarmUp, find_layout, layout_names
assert "corners_and_score" in layout_names()
rows = np.array([[[10, 20, 50, 60, 0.9], [10, 20, 50, 60, 0.1]]], dtype=np.float32)
layout = find_layout(WarmUp(("corners_and_score",), (rows,), (320, 320)))
found = layout.candidates((rows[0],), (320, 320), 0.5)
assert layout.name == "corners_and_score" and found.xyxy.tolist() == [[10, 20, 50, 60]]
""",
}


def sections() -> dict[str, str]:
    """Return the Python example under each heading of the page."""
    parts = re.split(r"^## (.+)$", PAGE.read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]
    return {
        heading: "\n".join(re.findall(r"```python\n(.*?)```", body, flags=re.DOTALL))
        for heading, body in zip(parts[::2], parts[1::2], strict=True)
    }


def test_every_example_has_a_use_here_and_at_most_30_lines() -> None:
    assert sections().keys() == USES.keys()
    assert {heading: len(code.splitlines()) for heading, code in sections().items() if code.count("\n") > 30} == {}


@pytest.mark.parametrize("heading", USES)
def test_the_example_runs_and_what_it_adds_is_chosen_by_name(heading: str) -> None:
    ran = subprocess.run(
        [sys.executable, "-c", sections()[heading] + USES[heading]], capture_output=True, text=True, timeout=120
    )
    assert ran.returncode == 0, ran.stderr
