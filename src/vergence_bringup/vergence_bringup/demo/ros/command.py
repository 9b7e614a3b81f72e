"""`vergence demo`: the graph on a simulated head, in a room or before photographs, as processes, and a report."""

import argparse
import contextlib
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import FrameType
from typing import Any

from vergence_bringup.demo.photo_report import write_overview
from vergence_bringup.demo.photographs import CLICKS, SHORT_CLICKS, Photographs, open_photographs
from vergence_bringup.demo.report import write_report
from vergence_bringup.demo.result import StationResult, all_passed, duration_text, table, verdict_line, write_summary
from vergence_bringup.demo.stations import Station, stations
from vergence_bringup.demo.visits import Runner, visit_all
from vergence_bringup.machine import shell_hint
from vergence_bringup.node_table import PHOTOGRAPHED
from vergence_bringup.page_address import page_address
from vergence_bringup.ros.processes import NodeCommand, ProcessGroup, config_dir, environment
from vergence_bringup.ros.simulated_head import simulated_head
from vergence_common.domains import own_domain
from vergence_rig.regular_file import expanded
from vergence_rig.rig import Joints, Rig
from vergence_rig.rig_file import load_rig, write_rig
from vergence_rig.servo import IDEAL
from vergence_sim.heads import HeadParameters
from vergence_sim.heads import simulated_head as simulated_rig


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of the subcommand."""
    parser.add_argument(
        "--out", type=expanded, default=Path("out/demo"), help="folder of the report (default: out/demo)"
    )
    parser.add_argument(
        "--photos",
        nargs="*",
        metavar=("LEFT", "RIGHT"),
        help="photographs of a rectified stereo pair as the world: both eyes look at points of them; without paths "
        "scikit-image's stereo pair",
    )
    parser.add_argument(
        "--short", action="store_true", help="three stations instead of eight, or instead of six of photographs"
    )
    parser.add_argument("--ideal", action="store_true", help="ideal servos and cameras instead of realistic ones")
    parser.add_argument("--station", action="append", metavar="NAME", help="only this station (may be repeated)")
    parser.add_argument(
        "--real-time",
        action="store_true",
        help="run by the wall clock, whether or not this machine keeps up (default: in simulated time, which waits)",
    )
    parser.add_argument("--no-page", action="store_true", help="without web_node, the page that shows the head at work")
    parser.add_argument("--seed", type=int, default=0, help="seed of the simulator's noise (default: 0)")


def run(options: argparse.Namespace) -> int:
    """Run the demo; 0 only if every station was reported verged and the ground truth agrees."""
    rig = _described_rig(options.ideal)
    short = options.short and not options.station
    photographs: Photographs | None = None
    if options.photos is not None:
        photographs = open_photographs(options.photos, options.out, SHORT_CLICKS if short else CLICKS)
    chosen = stations(rig.baseline_m, short) if photographs is None else photographs.stations(rig)
    if options.station:
        known = {station.name: station for station in chosen}
        for name in options.station:
            if name not in known:
                raise ValueError(f"--station must be one of {', '.join(known)}: got {name!r}")
        chosen = [known[name] for name in options.station]

    signal.signal(signal.SIGTERM, _interrupt)
    os.environ.update(environment())
    with contextlib.ExitStack() as stack:
        if "ROS_DOMAIN_ID" not in os.environ:
            # Separate from every other head on this machine.
            os.environ["ROS_DOMAIN_ID"] = str(stack.enter_context(own_domain()))
            _say(f"to watch from another shell: {shell_hint()}; export ROS_DOMAIN_ID={os.environ['ROS_DOMAIN_ID']}")
        return _run(options, rig, chosen, photographs)


def _run(options: argparse.Namespace, rig: Rig, chosen: list[Station], photographs: Photographs | None) -> int:
    started = time.monotonic()
    results: list[StationResult] = []
    commands = _commands(options, rig, photographs)
    _say(f"starting {', '.join(commands)} (logs in {options.out / 'log'})")
    with ProcessGroup(log_dir=options.out / "log") as processes:
        for name, command in commands.items():
            processes.start(name, command)
        if "web_node" in commands:
            address = page_address(options.out / "log" / "web_node.log", processes.check)
            _say(f"while the demo runs, the page of the head is at {address}")
        with _runner(options, rig, photographs, processes.check) as runner:
            visit_all(runner, chosen, results, _say)
            time_figures = runner.time_figures()
        _say("stopping the nodes")
        statuses = processes.stop()
    for name, status in statuses.items():
        if status != 0:
            _say(f"{name} ended with status {status}: see {options.out / 'log' / name}.log")

    settings: dict[str, Any] = {
        "servo": "ideal" if options.ideal else "sg90",
        "cameras": "ideal" if options.ideal else "realistic",
        "duration_s": round(time.monotonic() - started, 1),
        **time_figures,
    }
    if photographs is not None:
        settings["photographs"] = photographs.as_json()
        write_overview(photographs.pair, results, options.out / "pictures")
    write_summary(options.out / "summary.json", results, settings)
    write_report(options.out / "report.html", results, settings, options.out)
    print()
    print(table(results))
    print(f"\n{verdict_line(results)}")
    print(duration_text(settings))
    print(f"report: {options.out / 'report.html'}   figures: {options.out / 'summary.json'}")
    return 0 if all_passed(results) and not any(statuses.values()) else 1


@contextlib.contextmanager
def _runner(
    options: argparse.Namespace, rig: Rig, photographs: Photographs | None, check_alive: Callable[[], None]
) -> Iterator[Runner]:
    # Imported late: rclpy reads the middleware's environment when it is loaded.
    from vergence_bringup.demo.ros.photo_stage import PhotoStage
    from vergence_bringup.demo.ros.recorder import Recorder
    from vergence_bringup.demo.ros.stage import RoomStage, Stage
    from vergence_bringup.demo.ros.station_runner import StationRunner, tolerance_deg

    recorder = Recorder(stepped=not options.real_time)
    try:
        stage: Stage
        if photographs is None:
            stage = RoomStage(recorder, check_alive, ("target", "distractor"))
        else:
            stage = PhotoStage(recorder, check_alive, photographs)
        yield StationRunner(recorder, check_alive, stage, rig, tolerance_deg(rig, options.ideal), options.out)
    finally:
        recorder.close()


def _commands(options: argparse.Namespace, rig: Rig, photographs: Photographs | None) -> dict[str, NodeCommand]:
    path = (options.out / "rig.yaml").resolve()
    write_rig(path, rig)
    world: dict[str, object] = {"seed": options.seed, "preset": "ideal" if options.ideal else "realistic"}
    simulated_time = not options.real_time
    if photographs is None:
        commands = simulated_head(path, simulated_time=simulated_time, **world)
    else:
        commands = simulated_head(path, PHOTOGRAPHED, simulated_time=simulated_time, **world, **photographs.parameters)
    if not options.no_page:
        # Any free port: another head on this machine may have the usual one.
        page = {"rig": str(path), "use_sim_time": simulated_time, "port": 0}
        commands["web_node"] = NodeCommand.of("web_node", page)
    return commands


def _described_rig(ideal: bool) -> Rig:
    """Return what the nodes are given of the simulated head: its own description, or an ideal one without play."""
    rig = load_rig(config_dir() / "rig.yaml")
    if not ideal:
        return simulated_rig(HeadParameters(), rig)
    joints = (replace(joint, servo=IDEAL) for _, joint in rig.joints.items())
    return replace(rig, joints=Joints(*joints))


def _interrupt(number: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt


def _say(text: str) -> None:
    print(f"\033[1m[demo]\033[0m {text}" if sys.stdout.isatty() else f"[demo] {text}", flush=True)
