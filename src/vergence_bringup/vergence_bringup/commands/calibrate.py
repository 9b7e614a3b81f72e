"""`vergence calibrate`: dispatches to the kinds of calibration."""

import argparse

from vergence_bringup.commands import calibrate_cameras


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the kinds of calibration as subcommands."""
    kinds = parser.add_subparsers(dest="kind", required=True, metavar="KIND")
    cameras = kinds.add_parser("cameras", help="both cameras from chessboard or ChArUco views")
    calibrate_cameras.add_arguments(cameras)
    cameras.set_defaults(calibrate=calibrate_cameras.run)


def run(options: argparse.Namespace) -> int:
    """Run the chosen calibration."""
    return int(options.calibrate(options))
