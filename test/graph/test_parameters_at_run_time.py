"""No value of any parameter ends a running node: what a node cannot use is refused with the parameter's name."""

from pathlib import Path
from typing import Any

import pytest
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import ParameterValue
from rcl_interfaces.srv import GetParameters, SetParameters, SetParametersAtomically
from rclpy.node import Node
from rclpy.parameter import Parameter

from vergence_bringup.node_table import NODES, parameter_groups
from vergence_bringup.testing.ros.every_node import KINDS, parameters_without_hardware
from vergence_metric.ros.box_metric_node import BoxMetricNode
from vergence_metric.ros.edge_metric_node import EdgeMetricNode
from vergence_rig.testing.odd_values import ODD_VALUES

pytestmark = pytest.mark.graph


def _message(name: str, value: object) -> Any:
    return Parameter(name, value=value).to_parameter_msg()


class Client:
    """Sets parameters of a node as `ros2 param set` does."""

    def __init__(self, graph: Any, node: Node) -> None:
        self._graph = graph
        name = node.get_fully_qualified_name()
        self._set = graph.client.create_client(SetParameters, f"{name}/set_parameters")
        self._get = graph.client.create_client(GetParameters, f"{name}/get_parameters")
        graph.wait_until(lambda: self._set.service_is_ready() and self._get.service_is_ready(), "parameter services")

    def set(self, parameters: list[Any]) -> list[Any]:
        return list(self._graph.wait(self._set.call_async(SetParameters.Request(parameters=parameters))).results)

    def get(self, names: list[str]) -> list[Any]:
        return list(self._graph.wait(self._get.call_async(GetParameters.Request(names=names))).values)


def test_every_node_is_tried() -> None:
    assert set(KINDS) == set(NODES)


@pytest.mark.parametrize("executable", sorted(KINDS))
def test_no_value_of_any_parameter_ends_the_node(
    executable: str, graph: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest
) -> None:
    if executable == "sim_node":
        request.getfixturevalue("opengl")
    monkeypatch.setenv("ROS_HOME", str(tmp_path / "ros"))
    node = graph.start(KINDS[executable], **parameters_without_hardware(executable, tmp_path))
    client = Client(graph, node)
    names = [prefix + spec.name for prefix, group in parameter_groups(executable) for spec in group.specs()]
    before = dict(zip(names, client.get(names), strict=True))
    for name in [*names, "use_sim_time"]:
        results = client.set([_message(name, value) for value in ODD_VALUES])
        for value, result in zip(ODD_VALUES, results, strict=True):
            # Two parameters may contradict each other: then it is the other that is named.
            named = any(f"'{known}'" in result.reason for known in names) or name in result.reason
            assert result.successful or named, (name, value, result.reason)
        if name in names:
            node.set_parameters([Parameter.from_parameter_msg(_restored(name, before[name]))])
        else:
            assert client.set([_message(name, False)])[0].successful
    assert dict(zip(names, client.get(names), strict=True)) == before


def _restored(name: str, value: Any) -> Any:
    message = _message(name, 0)
    message.value = value
    return message


@pytest.mark.parametrize("kind", [SetParameters, SetParametersAtomically])
def test_a_type_that_ros_does_not_have_is_refused_by_name(graph: Any, kind: Any) -> None:
    graph.start(EdgeMetricNode)
    client = graph.client.create_client(kind, f"/edge_metric_node/{_snake(kind)}")
    graph.wait_until(client.service_is_ready, "the service is there")
    odd = ParameterMessage(name="threads", value=ParameterValue(type=99))
    answer = graph.wait(client.call_async(kind.Request(parameters=[odd])))
    result = answer.results[0] if kind is SetParameters else answer.result
    assert not result.successful
    assert result.reason == "parameter 'threads' must have a type of rcl_interfaces/ParameterType: got 99"


def _snake(kind: Any) -> str:
    return "set_parameters" if kind is SetParameters else "set_parameters_atomically"


def test_a_list_of_wrong_elements_is_refused_by_name(graph: Any) -> None:
    node = graph.start(BoxMetricNode)
    for value in ([0], True, [1.5], ["nonesuch"], ["²"], ["9" * 400]):
        result = graph.set_parameters(node, **{"detector.classes": value})
        assert not result.successful
        assert "'detector.classes'" in result.reason
    assert graph.set_parameters(node, **{"detector.classes": ["0"]}).successful
