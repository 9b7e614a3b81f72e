"""The command line of a node's executable: arguments that nothing reads, and `--help`."""

import shlex
import sys

import pytest

from vergence_common import node_main
from vergence_common.arguments import LeftoverArgumentsError, check_leftovers, remaps, without_ros


@pytest.mark.parametrize(
    ("line", "left"),
    [
        ("", ""),
        ("--ros-args -p a:=1", ""),
        ("--ros-args -p a:=1 --", ""),
        ("--params-file F -p backend:=x", "--params-file F -p backend:=x"),
        ("--x --ros-args -p a:=1 -- --y --ros-args -r a:=b", "--x --y"),
    ],
)
def test_what_is_not_ros(line: str, left: str) -> None:
    assert without_ros(shlex.split(line)) == shlex.split(left)


def test_leftovers_are_refused_with_the_command_that_was_meant() -> None:
    check_leftovers("servo_node", ["--ros-args", "-p", "backend:=x"])
    with pytest.raises(LeftoverArgumentsError) as refusal:
        check_leftovers("servo_node", ["--params-file", "my file", "-p", "backend:=x", "--ros-args", "-r", "a:=b"])
    text = str(refusal.value)
    meant = shlex.split(text.partition("write: ")[2])
    assert meant == ["servo_node", "--ros-args", "--params-file", "my file", "-p", "backend:=x", "-r", "a:=b"]
    check_leftovers(meant[0], meant[1:])


def test_remappings() -> None:
    assert remaps(["--ros-args", "-r", "a:=b", "--remap", "n:__ns:=/h", "-p", "c:=d"]) == [("a", "b"), ("n:__ns", "/h")]


def _never() -> None:
    """Stand for a node that must not be made."""
    raise AssertionError("a node was made")


@pytest.mark.parametrize("option", ["-h", "--help"])
def test_help_starts_nothing(option: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "argv", ["some_node"])
    assert node_main.run_node(_never, [option]) == 0
    out, err = capsys.readouterr()
    assert out.startswith("usage: some_node [-h] [--ros-args")
    assert "The command line of a node's executable" in out
    assert not err
