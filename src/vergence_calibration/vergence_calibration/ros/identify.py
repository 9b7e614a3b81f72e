"""`vergence identify`: measures timing and geometry of a running head, and writes its YAML."""

import argparse
import signal
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from vergence_calibration import backed_up_file
from vergence_calibration.geometry.bundle import Constraint
from vergence_calibration.geometry.geometry_report import geometry_lines, geometry_record
from vergence_calibration.geometry.identify_geometry import FoundGeometry, identify_geometry
from vergence_calibration.geometry.poses import PoseParameters
from vergence_calibration.geometry.stereo_file import mount_constraint, read_stereo
from vergence_calibration.identification.axis_log import IdentifyError, IdentifyParameters
from vergence_calibration.identification.identification import Identification, identify
from vergence_calibration.identification.identified_rig import identified_rig, nodes_text, record, recorded, rig_text
from vergence_calibration.identification.latencies import ASSUMPTIONS, Estimate
from vergence_calibration.identification.node_parameters import node_parameters
from vergence_calibration.ros.identified_head import TRANSPORTS, IdentifiedHead
from vergence_calibration.ros.running_head import HeadError
from vergence_rig.regular_file import expanded
from vergence_rig.rig import JOINT_NAMES
from vergence_rig.rig_file import load_rig

_REFUSED, _BAD_INPUT = 1, 2
_TIMING, _GEOMETRY = "timing", "geometry"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `vergence identify`."""
    parser.add_argument("--rig", default="", help="rig.yaml of the head (default: the built-in rig)")
    parser.add_argument(
        "--out", type=expanded, help="rig.yaml to write (default: that of --rig, else rig_identified.yaml)"
    )
    parser.add_argument(
        "--only",
        choices=(_TIMING, _GEOMETRY),
        help="half of the identification: latencies, signs and lost motion, or mounts, zeros, scales and cameras "
        "(default: both)",
    )
    parser.add_argument(
        "--axes", nargs="+", choices=JOINT_NAMES, default=list(JOINT_NAMES), help="axes of the timing (default: all)"
    )
    parser.add_argument(
        "--amplitude-deg", type=float, default=3.0, help="amplitude of the timing's moves (default %(default)s)"
    )
    parser.add_argument(
        "--steps", type=int, default=14, help="number of steps of each axis of the timing (default %(default)s)"
    )
    parser.add_argument(
        "--rest-s", type=float, default=0.45, help="rest after each move of the timing (default %(default)s)"
    )
    parser.add_argument(
        "--poses",
        type=int,
        default=PoseParameters().poses,
        help="number of poses of the geometry (default %(default)s)",
    )
    parser.add_argument(
        "--stereo",
        type=Path,
        help="stereo.yaml of `vergence calibrate cameras`, for the geometry (default: the one beside --rig, if any)",
    )
    parser.add_argument(
        "--assume",
        choices=ASSUMPTIONS,
        default="stamps",
        help="which are taken as correct, the images' stamps or joint_states (default %(default)s)",
    )
    parser.add_argument("--transport", choices=TRANSPORTS, default="auto", help="of the images (default %(default)s)")
    parser.add_argument("--timeout-s", type=float, default=20.0, help="longest wait for images (default %(default)s)")
    parser.add_argument("--namespace", default="", help="the head's namespace, if it has one")
    parser.add_argument("--yes", action="store_true", help="write without asking")


def run(options: argparse.Namespace) -> int:
    """Identify and write; returns 0 if written, 1 if refused or discarded, 2 for bad input."""
    _raise_on_signals()
    try:
        return _identify(options)
    except KeyboardInterrupt:
        print("\nended: nothing was written", file=sys.stderr)
        return _REFUSED
    except (IdentifyError, HeadError) as error:
        for line in str(error).splitlines():
            print(f"vergence identify: {line}", file=sys.stderr)
        return _REFUSED
    except (ValueError, OSError) as error:
        print(f"vergence identify: {error}", file=sys.stderr)
        return _BAD_INPUT


def _identify(options: argparse.Namespace) -> int:
    rig = load_rig(options.rig)
    timing = IdentifyParameters(amplitude_deg=options.amplitude_deg, steps=options.steps, rest_s=options.rest_s)
    poses = PoseParameters(poses=options.poses)
    constraints = _stereo(options)
    out: Path = options.out or Path(options.rig or "rig_identified.yaml")
    found: Identification | None = None
    geometry: FoundGeometry | None = None
    with IdentifiedHead(rig, options.namespace, options.transport, options.timeout_s) as head:
        try:
            for name in head.begin():
                _print(f"{name} is disabled during the identification")
            if options.only != _GEOMETRY:
                found = identify(head, options.axes, timing, options.assume, _print)
                rig = identified_rig(rig, found)
                owners = head.owners()
            if options.only != _TIMING:
                geometry = identify_geometry(head, rig, poses, constraints, _print)
                rig = geometry.rig
        finally:
            _ignore_signals()
    _raise_on_signals()
    records = recorded(options.rig)
    changes: dict[str, Any] = {}
    if found is not None:
        _print_latencies(found)
        records |= record(found)
        changes = node_parameters(found.latencies, owners)
    if geometry is not None:
        _print("\n" + "\n".join(geometry_lines(geometry)))
        records |= geometry_record(geometry)
    texts = {out: rig_text(rig, records, time.strftime("%Y-%m-%d %H:%M:%S"))}
    if changes:
        texts[out.with_name(f"{out.stem}.nodes.yaml")] = nodes_text(changes)
    return _write(texts, options.yes)


def _stereo(options: argparse.Namespace) -> tuple[Constraint, ...]:
    """Return the constraint of stereo.yaml: the named one, or the one beside --rig. Raises IdentifyError."""
    path: Path | None = options.stereo
    if path is None and options.rig and (beside := Path(options.rig).with_name("stereo.yaml")).exists():
        path = beside
    if path is None or options.only == _TIMING:
        return ()
    _print(f"the rotation between the cameras of {path} is used for the mounts")
    return (mount_constraint(read_stereo(path)),)


def _raise_on_signals() -> None:
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.default_int_handler)


def _ignore_signals() -> None:
    """Ignore interrupts while the eyes return and the controller is enabled: a few seconds at most."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)


def _write(texts: Mapping[Path, str], overwrite: bool) -> int:
    for path, text in texts.items():
        print(f"\n{backed_up_file.difference(path, text)}")
    if not overwrite and not _confirmed(f"\nwrite {' and '.join(map(str, texts))}? [y/N] "):
        print("nothing was written")
        return _REFUSED
    for path, text in texts.items():
        kept = backed_up_file.replace(path, text)
        print(f"wrote {path}" + (f"; the old one is {kept}" if kept else ""))
    return 0


def _confirmed(question: str) -> bool:
    try:
        return input(question).strip().lower() in ("y", "yes")
    except EOFError:
        print()
        return False


def _print(text: str) -> None:
    print(text, flush=True)


def _print_latencies(found: Identification) -> None:
    latencies = found.latencies
    _print(f"\ntime from a command to the arrival of an image that shows its motion: {_ms(latencies.loop_s)}")
    for eye, arrival in found.arrivals.items():
        worst = f"95 %: {1e3 * arrival.late_s:.1f}"
        _print(f"  {eye} images arrive {1e3 * arrival.median_s:.1f} ms after their stamps ({worst})")
    if latencies.eyes_apart_s.known:
        _print(f"  left stamps are late by {_ms(latencies.eyes_apart_s)} more than the right ones")
    _print(
        f"with {'image stamps' if latencies.assumption == 'stamps' else 'joint_states'} taken as correct (--assume):"
    )
    for joint, latency in latencies.servo_s.items():
        late = latencies.joints_late_s[joint]
        behind = f"; its joint_states are {_ms(late)} late" if late.known else "; joint_states do not show its motion"
        _print(f"  {joint} moves {_ms(latency)} after a command{behind}")
    for eye, wait in latencies.exposure_to_arrival_s.items():
        if wait.known:
            _print(f"  the {eye} camera takes {_ms(wait)} from exposure to arrival")


def _ms(estimate: Estimate) -> str:
    return f"{1e3 * estimate.value_s:.1f} +- {1e3 * estimate.sigma_s:.1f} ms"
