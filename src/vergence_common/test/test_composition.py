"""The command line of several nodes in one process."""

import pytest

from vergence_common.composition import parse

KNOWN = ["camera", "metric", "servo"]


def test_arguments_of_one_node_and_of_all_are_kept_apart() -> None:
    found = parse(
        KNOWN,
        ["camera", "metric"],
        "",
        ["--params", "camera=a.yaml", "--set", "metric:align.mode:=none", "--ros-args", "-r", "__ns:=/head"],
    )
    assert found.own == {
        "camera": ["--ros-args", "--params-file", "a.yaml"],
        "metric": ["--ros-args", "-p", "align.mode:=none"],
    }
    assert found.common == ["--ros-args", "-r", "__ns:=/head"]
    assert found.namespace == "/head"


def test_nodes_are_made_in_the_order_of_the_table() -> None:
    found = parse(KNOWN, ["camera"], "", ["--nodes", "servo,metric", "--params", "camera=a.yaml"])
    assert list(found.own) == ["metric", "servo"]
    assert found.namespace == ""


@pytest.mark.parametrize(
    "args", [["--nodes", "camera,hand"], ["--params", "hand=a.yaml"], ["--set", "camera"], ["--nodes", ""]]
)
def test_what_names_no_node_ends_the_process(args: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        parse(KNOWN, ["camera"], "", args)
    assert ended.value.code == 2
    assert "camera, metric, servo" in capsys.readouterr().err
