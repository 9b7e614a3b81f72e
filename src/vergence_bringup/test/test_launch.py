"""The launch files: which nodes run for which arguments, and which parameters the two cameras get."""

from pathlib import Path

import pytest

from vergence_bringup.node_table import NODES, SIMULATED, graph

pytest.importorskip("launch_ros", reason="launch is not installed here (it comes with ROS from apt)")

from launch import LaunchContext
from launch.actions import DeclareLaunchArgument, GroupAction
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch_ros.actions import Node
from launch_ros.utilities import evaluate_parameters

LAUNCH = Path(__file__).resolve().parents[1] / "launch"
CAMERAS = {"left_device": "/dev/video0", "right_device": "0"}


def nodes(file, **arguments):
    """Return (executable, parameters) of every node that runs with these arguments."""
    context = LaunchContext()
    context.launch_configurations.update(arguments)
    description = PythonLaunchDescriptionSource(str(LAUNCH / file)).get_launch_description(context)
    found = []
    for entity in description.entities:
        if isinstance(entity, DeclareLaunchArgument):
            entity.execute(context)
        if isinstance(entity, GroupAction):
            found += [action for action in entity.get_sub_entities() if isinstance(action, Node)]
    running = [node for node in found if node.condition is None or node.condition.evaluate(context)]
    return [(node.node_executable, parameters(node, context)) for node in running]


def test_composed_is_one_process_with_the_same_choice_of_nodes():
    names = {name for name, _ in nodes("rig.launch.py", **CAMERAS, composed="true")}
    assert "head_node" in names
    assert "head_node" not in {name for name, _ in nodes("rig.launch.py", **CAMERAS)}


def parameters(node, context):
    """Return a node's parameters beyond its YAML file. Launch has no public way to read them."""
    values = {}
    for part in evaluate_parameters(context, node._Node__parameters):
        if isinstance(part, dict):
            values.update(part)
    return values


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
        ("rig.launch.py", CAMERAS, {"camera_node", "servo_node"}, {"box_metric_node", "sim_node"}),
        ("rig.launch.py", {**CAMERAS, "detector": "true", "servos": "false"}, {"box_metric_node"}, {"servo_node"}),
    ],
)
def test_the_detector_runs_where_it_is_asked_for(file, arguments, runs, rests):
    names = {name for name, _ in nodes(file, **arguments)}
    assert runs <= names
    assert not rests & names
    assert names <= NODES.keys()


@pytest.mark.parametrize(
    ("namespace", "partner"),
    [("", "/left/camera_node"), ("head", "/head/left/camera_node"), ("/a/b", "/a/b/left/camera_node")],
)
def test_the_right_camera_follows_the_left_ones_held_exposure(namespace, partner):
    cameras = [given for name, given in nodes("rig.launch.py", **CAMERAS, namespace=namespace) if name == "camera_node"]
    assert [given["lock"] for given in cameras] == ["hold", "follow"]
    assert [given["partner"] for given in cameras] == ["", partner]
    assert [given["device"] for given in cameras] == ["/dev/video0", "0"]


def test_the_lock_can_be_left_off():
    cameras = [given for name, given in nodes("rig.launch.py", **CAMERAS, lock="false") if name == "camera_node"]
    assert [given["lock"] for given in cameras] == ["off", "off"]


def test_a_model_of_ones_own_reaches_the_detector():
    arguments = {**CAMERAS, "detector": "true", "model": "/models/fruit.onnx"}
    (given,) = (given for name, given in nodes("rig.launch.py", **arguments) if name == "box_metric_node")
    assert given["detector.model"] == "/models/fruit.onnx"
