"""Every YAML of config/ with something wrong in it: one line that names the file or the key, or a correct start."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import rclpy
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rclpy.context import Context
from rclpy.node import Node

from vergence_bringup.node_table import NODES, parameter_groups
from vergence_common.parameter_files import with_checked_files
from vergence_common.parameters import declare
from vergence_common.start import REFUSALS, one_line
from vergence_rig.parameters import Parameters
from vergence_rig.rig import Rig
from vergence_rig.rig_file import load_rig
from vergence_rig.testing.mutated_yaml import CHANGES, ODD_VALUES, mutated
from vergence_servo.calibration import load_servos

pytestmark = pytest.mark.graph

CONFIG = Path(__file__).resolve().parents[2] / "config"
MUTATIONS = st.tuples(st.sampled_from(CHANGES), st.integers(0, 300), st.sampled_from(ODD_VALUES))
OF_ROS_TOOLS = {"diagnostics"}


@pytest.fixture
def context(domain_id: int) -> Iterator[Context]:

    own = Context()
    rclpy.init(args=[], context=own, domain_id=domain_id)
    yield own
    own.try_shutdown()


def _refusal(start: Callable[[], object]) -> str:
    """Return why a start is refused as the user sees it; "" where it is not. Every other exception is a traceback."""
    try:
        start()
    except REFUSALS as error:
        return one_line(error)
    return ""


def _is_one_line(text: str) -> bool:
    return text.isprintable() and len(text) < 3000


def test_every_yaml_is_mutated_here() -> None:
    assert {path.stem for path in CONFIG.glob("*.yaml")} == {*NODES, "rig", "servos"} | OF_ROS_TOOLS


@pytest.mark.parametrize("executable", sorted(NODES))
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(mutation=MUTATIONS)
def test_a_nodes_own_file(executable: str, context: Context, tmp_path: Path, mutation: tuple) -> None:
    path = tmp_path / f"{executable}.yaml"
    path.write_bytes(mutated((CONFIG / path.name).read_text(encoding="utf-8"), *mutation))
    started: list[Parameters] = []

    def start() -> None:
        arguments = with_checked_files(["--ros-args", "--params-file", str(path)], [f"/{executable}"])
        node = Node(
            executable, context=context, cli_args=arguments, enable_rosout=False, start_parameter_services=False
        )
        try:
            started.append(declare(node, parameter_groups(executable), ("control.",)).value)
        finally:
            node.destroy_node()

    refusal = _refusal(start)
    assert _is_one_line(refusal)
    assert bool(refusal) != bool(started)


@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(mutation=MUTATIONS)
def test_the_rig(tmp_path: Path, mutation: tuple) -> None:
    path = tmp_path / "rig.yaml"
    path.write_bytes(mutated((CONFIG / "rig.yaml").read_text(encoding="utf-8"), *mutation))
    found: list[Rig] = []
    refusal = _refusal(lambda: found.append(load_rig(path)))
    assert _is_one_line(refusal)
    assert refusal.startswith(f"rig file '{path}'") if refusal else found


@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(mutation=MUTATIONS)
def test_the_servos(tmp_path: Path, mutation: tuple) -> None:
    path = tmp_path / "servos.yaml"
    path.write_bytes(mutated((CONFIG / "servos.yaml").read_text(encoding="utf-8"), *mutation))
    found: list[dict] = []
    refusal = _refusal(lambda: found.append(load_servos(path)))
    assert _is_one_line(refusal)
    assert refusal.startswith(f"servo file '{path}'") if refusal else found
