"""The `vergence` command: one module per subcommand, imported only when that subcommand runs."""

import argparse
import importlib
import sys
from collections.abc import Sequence

from vergence_bringup.machine import build_hint
from vergence_rig.middleware import middleware_problem
from vergence_rig.printed import printed_line

COMMANDS = {
    "demo": ("vergence_bringup.demo.ros.command", "run the graph on the simulated head and write a report"),
    "measure": ("vergence_bringup.commands.measure", "compute metric I (and II) of two stored images"),
    "calibrate": ("vergence_bringup.commands.calibrate", "calibrate the cameras from chessboard or ChArUco views"),
    "identify": (
        "vergence_calibration.ros.identify",
        "measure timing and geometry of a running head and write them to YAML",
    ),
    "fixation": ("vergence_bringup.commands.fixation", "where axes at the paper's angles C1 and C2 meet"),
    "look": ("vergence_bringup.ros.look", "look at a pixel, a class, a point or by angles, and say whether it verged"),
    "record": ("vergence_bringup.ros.record", "record a running head into a bag (MCAP)"),
    "replay": ("vergence_bringup.commands.replay", "measure a recording anew and print what changed"),
    "watch": ("vergence_bringup.ros.watch", "show a running graph in the terminal"),
    "doctor": ("vergence_bringup.commands.doctor", "check this machine: what is missing, and how to install it"),
}


_WITHOUT_GRAPH = {"measure", "doctor", "replay", "fixation"}


def main(args: Sequence[str] | None = None) -> int:
    """Run one subcommand and return its exit status: 0 success, 1 a check failed, 2 invalid input, 130 Ctrl-C."""
    try:
        try:
            options = _options(args)
        except ModuleNotFoundError as error:
            print(f"vergence: this command needs {error.name}: {_missing(error.name or '')}", file=sys.stderr)
            return 2
        try:
            return int(options.run(options))
        except (ValueError, OSError) as error:
            print(f"vergence {options.command}: {printed_line(error)}", file=sys.stderr)
            return 2
    except KeyboardInterrupt:
        return 130


def _missing(module: str) -> str:
    if module.startswith("vergence_"):
        return f"the package is not built here, or this shell does not have it ({build_hint()})"
    return "it is not installed here (vergence doctor says how to install it)"


def _options(args: Sequence[str] | None) -> argparse.Namespace:
    arguments = list(sys.argv[1:] if args is None else args)
    parser = argparse.ArgumentParser(prog="vergence", description="Tools of the Vergence binocular head.")
    subparsers = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    given = next((argument for argument in arguments if not argument.startswith("-")), None)
    for name, (module_name, summary) in COMMANDS.items():
        subparser = subparsers.add_parser(name, help=summary, description=summary)
        if name == given:
            problem = "" if name in _WITHOUT_GRAPH else middleware_problem()
            if problem:
                subparser.exit(2, f"vergence {name}: {problem}\n")
            module = importlib.import_module(module_name)
            module.add_arguments(subparser)
            subparser.set_defaults(run=module.run)
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
