"""`vergence calibrate cameras`: intrinsics of both eyes and their pose, from files or from the running cameras."""

import argparse
import sys
from collections.abc import Callable, Sequence
from itertools import zip_longest
from pathlib import Path

import cv2

from vergence_bringup.ros.live_board_views import collect_live
from vergence_camera.calibration.boards import BoardError, parse_board
from vergence_camera.calibration.report import intrinsics_text, pose_text, write_results
from vergence_camera.calibration.solve import Intrinsics, SolveError, StereoPose, check_sides, solve_camera, solve_pair
from vergence_camera.calibration.views import EYES, Verdict, ViewCollector
from vergence_rig.picture_file import Pixels, read_picture
from vergence_rig.printed import printed_line
from vergence_rig.regular_file import FileError, expanded

Say = Callable[[str], None]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.description = (
        "Calibrate the cameras with a chessboard or ChArUco board. With --left and --right the views are read from "
        "files, pair by pair; without, they come live from the running camera nodes (Ctrl-C ends the collection)."
    )
    parser.add_argument("--left", nargs="+", type=expanded, metavar="FILE", help="images of the left eye")
    parser.add_argument(
        "--right",
        nargs="+",
        type=expanded,
        metavar="FILE",
        help="images of the right eye, in the order of the left ones",
    )
    parser.add_argument(
        "--board",
        default="9x6",
        help="9x6: chessboard by its inner corners; charuco:8x6[:DICT_5X5_100]: ChArUco by its squares (default: 9x6)",
    )
    parser.add_argument("--square-m", type=float, default=0.025, metavar="M", help="side of a square (default: 0.025)")
    parser.add_argument("--marker-m", type=float, metavar="M", help="side of a marker (default: 3/4 of a square)")
    parser.add_argument("--out", type=expanded, required=True, metavar="DIR", help="folder for the three YAML files")
    live = parser.add_argument_group("live")
    live.add_argument("--views", type=int, default=25, metavar="N", help="number of views to collect (default: 25)")
    live.add_argument(
        "--eyes", choices=("both", "left", "right"), default="both", help="cameras to calibrate (default: both)"
    )
    live.add_argument(
        "--topics",
        nargs=2,
        default=("left/image_raw/compressed", "right/image_raw/compressed"),
        metavar=("LEFT", "RIGHT"),
        help="image topics; one that ends in /compressed carries JPEG",
    )
    live.add_argument(
        "--max-skew-s",
        type=float,
        default=0.02,
        metavar="S",
        help="largest difference of a pair's stamps (default: 0.02)",
    )


def run(args: argparse.Namespace, say: Say = print) -> int:
    """Calibrate, print the results and write the files; 0 if they were written, 2 for invalid input."""
    try:
        board = parse_board(args.board, args.square_m, args.marker_m)
        if args.left or args.right:
            collector = _from_files(ViewCollector(board), args.left or [], args.right or [], say)
        else:
            # Live, a view counts only where the board has moved since the last one.
            collector = collect_live(ViewCollector(board, least_change=0.04), args, say)
        cameras, pose = _solve(collector, say)
        board_values = {"pattern": args.board, "square_m": args.square_m}
        for path in write_results(args.out, cameras, pose, board_values):
            say(f"wrote {path}")
    except (BoardError, SolveError, OSError) as error:
        print(f"vergence calibrate cameras: {printed_line(error)}", file=sys.stderr)
        return 2
    return 0


def _from_files(collector: ViewCollector, left: Sequence[Path], right: Sequence[Path], say: Say) -> ViewCollector:
    if left and right and len(left) != len(right):
        raise BoardError(f"--left and --right must have equally many files: got {len(left)} and {len(right)}")
    total = max(len(left), len(right))
    for number, pair in enumerate(zip_longest(left, right), start=1):
        files = {eye: file for eye, file in zip(EYES, pair, strict=True) if file is not None}
        name = " + ".join(file.name for file in files.values())
        try:
            verdict = collector.offer(name, {eye: _picture(file) for eye, file in files.items()})
        except FileError as error:
            verdict = Verdict(name, False, str(error))
            collector.verdicts.append(verdict)
        say(f"[{number}/{total}] {name}: " + ("accepted" if verdict.accepted else f"rejected: {verdict.reason}"))
    return collector


def _picture(file: Path) -> Pixels:
    try:
        return read_picture(file, cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION)
    except FileError as error:
        raise FileError(f"not readable as images: {file} {error}") from error


def _solve(collector: ViewCollector, say: Say) -> tuple[dict[str, Intrinsics], StereoPose | None]:
    if not collector.views:
        _report_rejected(collector, {}, None, say)
        raise SolveError(f"none of the {len(collector.verdicts)} views can be used: nothing is written")
    cameras = {}
    for eye in collector.size_px:
        cameras[eye] = solve_camera(collector.views, eye, collector.size_px[eye])
        say(intrinsics_text(eye, cameras[eye], collector.coverage(eye)))
    pose = None
    if set(cameras) == set(EYES):
        left_out = {**cameras["left"].rejected, **cameras["right"].rejected}
        sound = [view for view in collector.views if view.name not in left_out]
        pose = solve_pair(sound, cameras["left"], cameras["right"])
        say(pose_text(pose))
        check_sides(pose)
    _report_rejected(collector, cameras, pose, say)
    return cameras, pose


def _report_rejected(
    collector: ViewCollector, cameras: dict[str, Intrinsics], pose: StereoPose | None, say: Say
) -> None:
    rejected = [(verdict.name, verdict.reason) for verdict in collector.verdicts if not verdict.accepted]
    for found in cameras.values():
        rejected += found.rejected.items()
    if pose is not None:
        rejected += pose.rejected.items()
    say(f"{len(collector.verdicts)} views offered, {len({name for name, _ in rejected})} rejected")
    for name, reason in rejected:
        say(f"   {name}: {reason}")
