"""The command line of an executable that runs several nodes in one process.

`--ros-args` count for all of them, with `-p NODE:NAME:=VALUE` for one. What is one node's own comes before:
`--nodes A,B` chooses them, `--params NODE=FILE` gives a node its YAML file (of `/**`), `--set NODE:NAME:=VALUE` one
value.
"""

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from rclpy.node import Node

from vergence_common.parameter_files import node_name, with_checked_files


@dataclass(frozen=True)
class Composition:
    """The chosen nodes with the ROS arguments of each, and those of all."""

    own: dict[str, list[str]]
    common: list[str]

    def maker(self, name: str, node: Callable[..., Node], *remappings: str, **options: Any) -> Callable[[], Node]:
        """Return what makes a node with its own arguments, parameter files checked, and with these options.

        Its module's name is that of the node.
        """

        def make() -> Node:
            arguments = [*self.own[name], *(part for rule in remappings for part in ("-r", rule))]
            full_name = node_name(node.__module__.rpartition(".")[2], [*self.common, *arguments])
            return node(cli_args=with_checked_files(arguments, [full_name]), **options)

        return make

    @property
    def namespace(self) -> str:
        """The namespace of all nodes, without a slash at its end."""
        given = [argument for argument in self.common if argument.startswith("__ns:=")]
        return given[-1].removeprefix("__ns:=").rstrip("/") if given else ""


def parse(known: Sequence[str], chosen: Sequence[str], description: str, args: Sequence[str] | None) -> Composition:
    """Read a command line; `known` nodes can be chosen, `chosen` are without `--nodes`. An error ends the process."""
    argv = list(sys.argv[1:] if args is None else args)
    split = argv.index("--ros-args") if "--ros-args" in argv else len(argv)
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--nodes", default=",".join(chosen), help=f"which of {', '.join(known)}")
    parser.add_argument("--params", action="append", default=[], metavar="NODE=FILE", help="a node's YAML file")
    parser.add_argument("--set", action="append", default=[], metavar="NODE:NAME:=VALUE", help="a node's parameter")
    given = parser.parse_args(argv[:split])
    own: dict[str, list[str]] = {name: ["--ros-args"] for name in filter(None, given.nodes.split(","))}
    for text, separator, option in [(t, "=", "--params-file") for t in given.params] + [
        (t, ":", "-p") for t in given.set
    ]:
        name, _, value = text.partition(separator)
        if name not in known or not value:
            parser.error(f"NODE must be one of {', '.join(known)}: got {text!r}")
        own.get(name, []).extend((option, value))
    unknown = [name for name in own if name not in known]
    if unknown or not own:
        parser.error(f"--nodes must be some of {', '.join(known)}: got {given.nodes!r}")
    return Composition({name: own[name] for name in known if name in own}, argv[split:])
