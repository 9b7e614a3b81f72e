"""The `vergence` command: one subcommand per file, imported only when it is asked for."""

import argparse
import importlib
import sys
from collections.abc import Sequence

COMMANDS = {
    "demo": ("vergence_bringup.demo.ros.command", "run the whole graph on the simulated head and write a report"),
    "measure": ("vergence_bringup.commands.measure", "metric I (and II) of two stored images"),
    "calibrate": ("vergence_bringup.commands.calibrate", "calibrate the cameras from chessboard or ChArUco views"),
    "identify": (
        "vergence_calibration.ros.identify",
        "latencies, pixels per radian and signs of a running head, into its YAML",
    ),
    "watch": ("vergence_bringup.ros.watch", "live terminal view of a running graph"),
    "doctor": ("vergence_bringup.commands.doctor", "say what is missing on this machine and how to mend it"),
}


def main(args: Sequence[str] | None = None) -> int:
    """Run one subcommand and return its exit status: 0 done, 1 the answer is no, 2 bad input."""
    arguments = list(sys.argv[1:] if args is None else args)
    parser = argparse.ArgumentParser(prog="vergence", description="Tools of the Vergence binocular head.")
    subparsers = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    asked = next((argument for argument in arguments if not argument.startswith("-")), None)
    for name, (module_name, summary) in COMMANDS.items():
        subparser = subparsers.add_parser(name, help=summary, description=summary)
        if name == asked:
            module = importlib.import_module(module_name)
            module.add_arguments(subparser)
            subparser.set_defaults(run=module.run)
    options = parser.parse_args(arguments)
    try:
        return int(options.run(options))
    except KeyboardInterrupt:
        return 130
    except (ValueError, OSError) as error:
        print(f"vergence {options.command}: {error}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main())
