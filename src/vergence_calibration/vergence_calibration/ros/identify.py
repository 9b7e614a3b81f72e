"""`vergence identify`: measures latencies, pixels per radian and signs of a running head, and writes its YAML."""

import argparse
import signal
import sys
import time
from collections.abc import Mapping
from pathlib import Path

from vergence_calibration import backed_up_file
from vergence_calibration.identification.axis_log import IdentifyError, IdentifyParameters
from vergence_calibration.identification.identification import Identification, identify
from vergence_calibration.identification.identified_rig import identified_rig, nodes_text, rig_text
from vergence_calibration.identification.latencies import ASSUMPTIONS, Estimate
from vergence_calibration.identification.node_parameters import node_parameters
from vergence_calibration.ros.identified_head import TRANSPORTS, IdentifiedHead
from vergence_calibration.ros.running_head import HeadError
from vergence_rig.regular_file import expanded
from vergence_rig.rig import JOINT_NAMES
from vergence_rig.rig_file import load_rig

_REFUSED, _BAD_INPUT = 1, 2


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `vergence identify`."""
    parser.add_argument("--rig", default="", help="rig.yaml of the head (default: the built-in rig)")
    parser.add_argument(
        "--out", type=expanded, help="rig.yaml to write (default: that of --rig, else rig_identified.yaml)"
    )
    parser.add_argument(
        "--axes", nargs="+", choices=JOINT_NAMES, default=list(JOINT_NAMES), help="axes to identify (default: all)"
    )
    parser.add_argument("--amplitude-deg", type=float, default=3.0, help="amplitude of the moves (default %(default)s)")
    parser.add_argument("--steps", type=int, default=14, help="number of steps of each axis (default %(default)s)")
    parser.add_argument("--rest-s", type=float, default=0.45, help="rest after each move (default %(default)s)")
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
    parameters = IdentifyParameters(amplitude_deg=options.amplitude_deg, steps=options.steps, rest_s=options.rest_s)
    out: Path = options.out or Path(options.rig or "rig_identified.yaml")
    with IdentifiedHead(rig, options.namespace, options.transport, options.timeout_s) as head:
        try:
            for name in head.begin():
                _print(f"{name} is disabled during the identification")
            found = identify(head, options.axes, parameters, options.assume, _print)
            owners = head.owners()
        finally:
            _ignore_signals()
    _raise_on_signals()
    _print_latencies(found)
    texts = {out: rig_text(identified_rig(rig, found), found, time.strftime("%Y-%m-%d %H:%M:%S"))}
    changes = node_parameters(found.latencies, owners)
    if changes:
        texts[out.with_name(f"{out.stem}.nodes.yaml")] = nodes_text(changes)
    return _write(texts, options.yes)


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
