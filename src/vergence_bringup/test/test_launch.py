"""The launch files, evaluated by the real launch: which nodes run for which arguments, and with which parameters.

They are included as `ros2 launch` includes them. The values that are allowed are checked in test_launch_arguments.py,
which needs no launch.
"""

import os
import sys
from pathlib import Path

import pytest

from vergence_bringup.launching.arguments import ARGUMENTS
from vergence_bringup.node_table import NODES, SIMULATED, graph

pytest.importorskip("launch_ros", reason="launch is not installed here (it comes with ROS from apt)")

from launch import LaunchContext
from launch.actions import EmitEvent, IncludeLaunchDescription, LogInfo
from launch.events.process import ProcessExited
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.utilities import perform_substitutions
from launch_ros.actions import Node, SetRemap
from launch_ros.utilities import evaluate_parameters

from vergence_bringup.ros import launch_actions

LAUNCH = Path(__file__).resolve().parents[1] / "launch"
SERVOS = Path(__file__).resolve().parents[1] / "config" / "servos.yaml"
CAMERAS = {"left_device": "/dev/video0", "right_device": "0"}
REQUIRED = {
    "sim.launch.py": {},
    "rig.launch.py": CAMERAS,
    "laptop.launch.py": CAMERAS,
    "pi.launch.py": {"servos": str(SERVOS)},
}


@pytest.fixture(autouse=True)
def same_everywhere(monkeypatch):
    # SetEnvironmentVariable writes to this process's environment; a machine may have robot_state_publisher or not.
    monkeypatch.setattr(os, "environ", os.environ.copy())
    monkeypatch.setattr(launch_actions, "_installed", lambda package: False)


def actions(file, arguments, context=None):
    """Return every action that `ros2 launch vergence_bringup FILE NAME:=VALUE...` executes; nodes are not started."""
    included = IncludeLaunchDescription(
        PythonLaunchDescriptionSource(str(LAUNCH / file)), launch_arguments=arguments.items()
    )
    return list(visited(included, context or LaunchContext()))


def visited(entity, context):
    yield entity
    if not isinstance(entity, Node):
        for part in entity.visit(context) or []:
            yield from visited(part, context)


def nodes(file, **arguments):
    """Return (executable, parameters) of every node that runs with these arguments."""
    context = LaunchContext()
    found = [action for action in actions(file, REQUIRED[file] | arguments, context) if isinstance(action, Node)]
    return [(node.node_executable, parameters(node, context)) for node in found]


def test_composed_is_one_process_with_the_same_choice_of_nodes():
    names = {name for name, _ in nodes("rig.launch.py", **CAMERAS, composed="true")}
    assert "head_node" in names
    assert "head_node" not in {name for name, _ in nodes("rig.launch.py", **CAMERAS)}


def parameters(node, context):
    """Return a node's parameters beyond its YAML file. Launch has no public way to read them."""
    values: dict[str, object] = {}
    for part in evaluate_parameters(context, node._Node__parameters):
        values |= part if isinstance(part, dict) else {}
    return values


def said(found, context):
    return "\n".join(perform_substitutions(context, info.msg) for info in found if isinstance(info, LogInfo))


@pytest.mark.parametrize("file", sorted(ARGUMENTS))
def test_every_launch_file_starts_with_its_required_arguments_alone(file):
    names = {name for name, _ in nodes(file)}
    assert names
    assert names <= NODES.keys()


@pytest.mark.parametrize("file", sorted(ARGUMENTS))
def test_every_launch_file_declares_the_arguments_of_the_table(file):
    description = PythonLaunchDescriptionSource(str(LAUNCH / file)).get_launch_description(LaunchContext())
    declared = {argument.name: argument for argument in description.get_launch_arguments()}
    assert list(declared) == [argument.name for argument in ARGUMENTS[file]]
    for argument in ARGUMENTS[file]:
        assert (declared[argument.name].default_value is None) == argument.required
        assert declared[argument.name].description == argument.help()


@pytest.mark.parametrize("file", ["rig.launch.py", "laptop.launch.py"])
def test_the_cameras_must_be_given(file):
    with pytest.raises(RuntimeError, match="missing required argument 'right_device'"):
        actions(file, {"left_device": "0"})


def test_the_simulated_head_is_the_whole_graph_of_the_table():
    assert {name for name, _ in nodes("sim.launch.py")} == set(graph(SIMULATED))


@pytest.mark.parametrize(("arguments", "simulated"), [({}, False), ({"use_sim_time": "true"}, True)])
def test_every_node_of_the_simulated_head_has_one_time(arguments, simulated):
    assert {given["use_sim_time"] for _, given in nodes("sim.launch.py", **arguments)} == {simulated}


@pytest.mark.parametrize(
    ("file", "arguments", "runs", "rests"),
    [
        ("sim.launch.py", {}, {"sim_node", "edge_metric_node", "box_metric_node", "gaze_controller_node"}, set()),
        ("sim.launch.py", {"detector": "false"}, {"sim_node"}, {"box_metric_node"}),
        ("sim.launch.py", {"encoder": "false"}, {"sim_node"}, {"eye_rotation_node"}),
        ("sim.launch.py", {"web": "true"}, {"sim_node", "web_node"}, set()),
        ("rig.launch.py", {}, {"camera_node", "servo_node"}, {"box_metric_node", "sim_node", "web_node"}),
        ("rig.launch.py", {"web": "true"}, {"camera_node", "servo_node", "web_node"}, set()),
        ("rig.launch.py", {"detector": "true", "servo_node": "false"}, {"box_metric_node"}, {"servo_node"}),
        ("laptop.launch.py", {}, {"camera_node", "gaze_controller_node", "eye_rotation_node"}, {"servo_node"}),
        ("laptop.launch.py", {"detector": "true", "encoder": "false"}, {"box_metric_node"}, {"eye_rotation_node"}),
    ],
)
def test_the_nodes_that_were_asked_for_run(file, arguments, runs, rests):
    names = {name for name, _ in nodes(file, **arguments)}
    assert runs <= names
    assert not rests & names


@pytest.mark.parametrize("file", ["rig.launch.py", "laptop.launch.py"])
@pytest.mark.parametrize(
    ("namespace", "partner"),
    [("", "/left/camera_node"), ("head", "/head/left/camera_node"), ("/a/b", "/a/b/left/camera_node")],
)
def test_the_right_camera_follows_the_left_ones_held_exposure(file, namespace, partner):
    cameras = [given for name, given in nodes(file, namespace=namespace) if name == "camera_node"]
    assert [given["lock"] for given in cameras] == ["hold", "follow"]
    assert [given["partner"] for given in cameras] == ["", partner]
    assert [given["device"] for given in cameras] == ["/dev/video0", "0"]


def test_the_lock_can_be_left_off():
    cameras = [given for name, given in nodes("rig.launch.py", lock="false") if name == "camera_node"]
    assert [given["lock"] for given in cameras] == ["off", "off"]


@pytest.mark.parametrize("file", ["sim.launch.py", "rig.launch.py", "laptop.launch.py"])
def test_attention_is_chosen_by_an_argument(file):
    def start(**arguments):
        return next(given for name, given in nodes(file, **arguments) if name == "gaze_controller_node").get("start")

    assert start(attend="true") == "attend"
    assert start() is None


def test_a_model_of_ones_own_reaches_the_detector(tmp_path):
    model = tmp_path / "fruit.onnx"
    model.touch()
    (given,) = (
        given for name, given in nodes("rig.launch.py", detector="true", model=str(model)) if name == "box_metric_node"
    )
    assert given["detector.model"] == str(model)


@pytest.mark.parametrize(
    ("file", "arguments", "backend"),
    [
        ("rig.launch.py", {}, "fake"),
        ("rig.launch.py", {"servos": str(SERVOS)}, "kernel_pwm"),
        ("rig.launch.py", {"servos": str(SERVOS), "backend": "pca9685"}, "pca9685"),
        ("pi.launch.py", {}, "kernel_pwm"),
        ("pi.launch.py", {"backend": "pca9685"}, "pca9685"),
    ],
)
def test_the_servos_and_their_driver_reach_servo_node(file, arguments, backend):
    (given,) = (given for name, given in nodes(file, **arguments) if name == "servo_node")
    assert given["backend"] == backend
    assert given["servos"] == (REQUIRED[file] | arguments).get("servos", "")


@pytest.mark.parametrize(("arguments", "fake"), [({}, True), ({"servos": str(SERVOS)}, False)])
def test_a_head_on_fakes_says_so_in_big_letters(arguments, fake):
    context = LaunchContext()
    text = said(actions("rig.launch.py", CAMERAS | arguments, context), context)
    assert ("NO SERVO MOVES" in text) == fake
    assert ("!!!!!!!!!!" in text) == fake


@pytest.mark.parametrize(
    ("file", "arguments", "problem"),
    [
        ("sim.launch.py", {"detector": "no"}, "detector must be true or false: got 'no'"),
        ("rig.launch.py", {"servos": "false"}, "servos must be the path of an existing file: got 'false'"),
        ("rig.launch.py", {"backend": "kernel_pwm"}, "servos must be the path of your servos.yaml"),
        ("rig.launch.py", {"backend": "gpiozero"}, "11 positions"),
        ("laptop.launch.py", {"lock": "off"}, "lock must be true or false: got 'off'"),
        ("pi.launch.py", {"start": "now"}, "start must be released or last_pose: got 'now'"),
    ],
)
def test_wrong_values_end_the_launch_before_anything_starts(file, arguments, problem):
    context, started = LaunchContext(), list[Node]()
    included = IncludeLaunchDescription(
        PythonLaunchDescriptionSource(str(LAUNCH / file)), launch_arguments=(REQUIRED[file] | arguments).items()
    )
    with pytest.raises(ValueError, match="starts nothing") as caught:
        started.extend(entity for entity in visited(included, context) if isinstance(entity, Node))
    assert problem in str(caught.value)
    assert started == []


def test_an_argument_that_does_not_exist_ends_the_launch(monkeypatch):
    monkeypatch.setattr(sys, "argv", ["ros2", "launch", "vergence_bringup", "sim.launch.py", "detectr:=false"])
    with pytest.raises(ValueError, match="did you mean 'detector'"):
        nodes("sim.launch.py", detectr="false")


@pytest.mark.parametrize("file", ["sim.launch.py", "rig.launch.py", "laptop.launch.py"])
def test_the_heads_frames_are_published_where_that_is_possible(file, monkeypatch, tmp_path):
    rig = tmp_path / "rig.yaml"
    rig.write_text("baseline_m: 0.08\n")
    assert "robot_state_publisher" not in dict(nodes(file))
    with pytest.raises(ValueError, match="ros-jazzy-robot-state-publisher"):
        nodes(file, frames="true")
    monkeypatch.setattr(launch_actions, "_installed", lambda package: True)
    given = dict(nodes(file, rig=str(rig)))["robot_state_publisher"]
    assert 'xyz="0.0 0.04 0.0"' in given["robot_description"]
    assert "robot_state_publisher" not in dict(nodes(file, frames="false"))


@pytest.mark.parametrize("file", sorted(ARGUMENTS))
def test_a_head_in_a_namespace_has_a_tf_tree_of_its_own(file):
    context = LaunchContext()
    remaps = [action for action in actions(file, REQUIRED[file], context) if isinstance(action, SetRemap)]
    pairs = {tuple(perform_substitutions(context, part) for part in (remap.src, remap.dst)) for remap in remaps}
    assert pairs == {("/tf", "tf"), ("/tf_static", "tf_static")}


@pytest.mark.parametrize(
    ("file", "executable", "status", "ends"),
    [
        ("sim.launch.py", "sim_node", 2, True),
        ("sim.launch.py", "gaze_controller_node", -9, True),
        ("sim.launch.py", "box_metric_node", 2, False),
        ("rig.launch.py", "camera_node", 1, True),
        ("rig.launch.py", "servo_node", -11, True),
        ("pi.launch.py", "servo_node", -11, False),
        ("pi.launch.py", "servo_node", 2, True),
        ("pi.launch.py", "servo_node", 0, True),
    ],
)
def test_the_end_of_a_node_is_reported_and_ends_the_launch_where_it_is_needed(file, executable, status, ends):
    context = LaunchContext()
    (node, *_) = (
        action
        for action in actions(file, REQUIRED[file], context)
        if isinstance(action, Node) and action.node_executable == executable
    )
    event = ProcessExited(action=node, name=executable, cmd=[executable], cwd=None, env=None, pid=1, returncode=status)
    on_exit = node._ExecuteLocal__on_exit
    follows = on_exit(event, context)
    assert executable in said(follows, context)
    assert any(isinstance(action, EmitEvent) for action in follows) == ends
    context._set_is_shutdown(True)
    assert on_exit(event, context) is None
