"""The command line of an executable that runs nodes: what is ROS's, what is left over, and `--help`."""

import shlex
import textwrap
from collections.abc import Sequence
from itertools import pairwise

from vergence_rig.parameters import Groups, ParameterSpec

ROS_ARGS, END_OF_ROS_ARGS = "--ros-args", "--"
HELP = ("-h", "--help")
_WIDTH = 100


class LeftoverArgumentsError(ValueError):
    """Arguments that nothing reads."""


def without_ros(arguments: Sequence[str]) -> list[str]:
    """Return the arguments outside `--ros-args ... --`."""
    left: list[str] = []
    ros = False
    for argument in arguments:
        if argument == ROS_ARGS:
            ros = True
        elif ros and argument == END_OF_ROS_ARGS:
            ros = False
        elif not ros:
            left.append(argument)
    return left


def check_leftovers(executable: str, arguments: Sequence[str]) -> None:
    """Raise LeftoverArgumentsError, with the command that was probably meant, unless all arguments are ROS's."""
    left = without_ros(arguments)
    if not left:
        return
    meant = shlex.join([executable, ROS_ARGS, *(a for a in arguments if a not in (ROS_ARGS, END_OF_ROS_ARGS))])
    raise LeftoverArgumentsError(f"arguments must follow {ROS_ARGS}: got {shlex.join(left)!r}; write: {meant}")


def remaps(arguments: Sequence[str]) -> list[tuple[str, str]]:
    """Return (from, to) of every remapping among the arguments of ROS."""
    rules = [rule for option, rule in pairwise(arguments) if option in ("-r", "--remap") and ":=" in rule]
    return [(rule.partition(":=")[0], rule.partition(":=")[2]) for rule in rules]


def help_text(executable: str, description: str, groups: Groups) -> str:
    """Return what `--help` prints: usage, what the executable does, and its parameters."""
    lines = [
        f"usage: {executable} [-h] [{ROS_ARGS} [-p NAME:=VALUE ...] [--params-file FILE] [-r FROM:=TO ...]]",
        "",
        *textwrap.wrap(" ".join(description.split()), _WIDTH),
    ]
    if groups:
        lines += ["", "parameters:"]
    for prefix, group in groups:
        for spec in group.specs():
            lines.append(f"  {prefix}{spec.name} ({_default(spec)})")
            text = f"{spec.description}; {spec.allowed}"
            lines += textwrap.wrap(text, _WIDTH, initial_indent="      ", subsequent_indent="      ")
    return "\n".join(lines)


def _default(spec: ParameterSpec) -> str:
    if spec.required:
        return "required"
    return f"default {list(spec.default) if spec.is_list else spec.default!r}"
