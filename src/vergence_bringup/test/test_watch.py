"""The lines of `vergence watch`, from messages made by hand."""

import math
import re

from sensor_msgs.msg import JointState

from vergence_bringup.figures.watch_screen import Screen, Snapshot
from vergence_msgs.msg import BoxVergence, EdgeVergence, GazeState, VergenceError
from vergence_rig.stream import Stream

TOPICS = ("vergence/edge", "vergence/error", "vergence/box", "gaze/state", "joint_command", "joint_states")
LIMITS = {"pan_left": (-1.0, 1.0), "tilt": (-0.5, 0.5)}


def streams() -> dict[str, Stream]:
    return {topic: Stream() for topic in TOPICS}


def view(made: dict[str, Stream], now_s: float = 10.0, width: int = 110, **more: object) -> list[str]:
    health = more.get("health", {})
    assert isinstance(health, dict)
    return Screen(LIMITS).lines(Snapshot(now_s, 1000.0, made, health), width, colour=bool(more.get("colour")))


def filled() -> dict[str, Stream]:
    made = streams()
    edge = EdgeVergence(windows_px=[50, 300], left_to_right_px=[1.25, math.nan], right_to_left_px=[1.5, 7.0])
    edge.contrast, edge.status = [0.31, 1.02], [0, 1]
    state = GazeState(phase_name="fixate", verged=True, reason="error small", law="predictive", mode="both_eyes")
    state.version_rad, state.distance_m, state.distance_high_m = math.radians(5.0), 0.5, math.inf
    for i in range(31):
        at_s = 9.0 + i / 30
        made["joint_states"].add(JointState(name=["pan_left", "tilt"], position=[0.5, 0.49]), at_s)
        made["joint_command"].add(JointState(name=["pan_left"], position=[0.25]), at_s)
    made["vergence/edge"].add(edge, 10.0)
    made["vergence/error"].add(VergenceError(horizontal_px=-3.5, confidence=0.9, estimator="zncc"), 10.0)
    made["gaze/state"].add(state, 10.0)
    return made


def test_an_empty_graph_says_what_is_missing():
    text = "\n".join(view(streams()))
    for topic in ("gaze/state", "vergence/edge", "joint_states", "/diagnostics"):
        assert f"no {topic} yet" in text
    assert text.count("silent") == len(TOPICS)


def test_metric_gaze_joints_and_rates_are_shown():
    text = "\n".join(view(filled()))
    assert re.search(r"fixate +verged +error small", text)
    assert re.search(r"50 px +1\.25 px +1\.50 px +0\.31", text)
    assert re.search(r"300 px +- +px +7\.00 px", text)
    assert "error  -3.50 px" in text
    assert re.search(r"pan_left +\+28\.65° .*\[.*#.*\] .*-> +\+14\.32°", text)
    assert re.search(r"joint_states +30\.0 Hz +0\.00 s ago", text)
    assert "to inf" in text


def test_the_distance_of_a_detected_target_has_its_interval():
    made = filled()
    face = BoxVergence(class_name="face", center_horizontal_px=12.5)
    face.distance_m, face.distance_low_m, face.distance_high_m = 1.0, 0.85, 1.2
    made["vergence/box"].add(face, 10.0)
    (line,) = (line for line in view(made) if "boxes face" in line)
    assert re.search(r"boxes face +12\.50 px  1\.00 m \(0\.85 to 1\.20 m\)", line)
    face.distance_m = math.nan
    assert "0.85" not in next(line for line in view(made) if "boxes face" in line)


def test_no_line_is_wider_than_the_terminal():
    assert max(len(line) for line in view(filled(), width=50)) <= 50


def test_silence_is_marked_and_old_commands_are_not_shown():
    text = "\n".join(view(filled(), now_s=12.0, colour=True))
    assert "->" not in text
    assert re.search(r"\033\[31m  joint_states.* 2\.00 s ago", text)


def test_the_worst_health_comes_first_and_dead_nodes_are_gone():
    health = {
        "a: fine": (0, "all well", 10.0),
        "servo_node: tilt": (2, "Remote I/O error", 10.0),
        "b: silent": (0, "was well", 1.0),
    }
    lines = view(streams(), health=health)
    shown = [line for line in lines if ": " in line]
    assert "ERROR servo_node: tilt: Remote I/O error" in shown[0].replace("  ", " ").strip()
    assert any("gone" in line and "b: silent" in line for line in lines)
