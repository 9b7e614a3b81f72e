"""calibrate_servos: measures each servo's pulses, angles and limits, by hand or from the cameras' images.

By hand, with servo_node not running:
    calibrate_servos --servos servos.yaml --backend kernel_pwm
By the cameras, with the whole head running (servo_node too):
    calibrate_servos --servos servos.yaml --visual
"""

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import yaml

from vergence_calibration import backed_up_file
from vergence_calibration.servos import servo_file
from vergence_calibration.servos.jog_session import JogSession
from vergence_calibration.servos.terminal import NoTerminalError, Terminal
from vergence_rig.regular_file import expanded
from vergence_rig.rig_file import load_rig
from vergence_servo.calibration import ServoCalibration, ServoCalibrationError, default_servos, load_servos
from vergence_servo.driver_set import DriverSet, backends_of
from vergence_servo.drivers.protocol import DriverIoError, ServoDriver

_HELP = "arrows: 10 and 1 us, page keys: 50 us, [ 0 ] a: record, r: release, Enter: done, Esc: discard"


def main(args: Sequence[str] | None = None) -> int:
    """Run; returns 0 if written or unchanged, 1 if discarded, 2 for bad input."""
    parser = argparse.ArgumentParser(
        prog="calibrate_servos", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--servos", required=True, type=expanded, help="servos.yaml to update; created if missing")
    parser.add_argument(
        "--joint", action="append", help="calibrate only this joint (repeatable; default: all in the file)"
    )
    parser.add_argument(
        "--backend", default="kernel_pwm", help="driver of the servos that name none in the file (default %(default)s)"
    )
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="a parameter of the servo driver of --backend, such as address=65; of another one: pca9685.address=65",
    )
    parser.add_argument("--yes", action="store_true", help="write without asking")
    parser.add_argument(
        "--visual", action="store_true", help="calibrate from the cameras' images; the head must be running"
    )
    parser.add_argument("--rig", default="", help="rig.yaml, for --visual")
    parser.add_argument("--namespace", default="", help="the head's namespace, for --visual")
    parser.add_argument(
        "--amplitude-deg", type=float, default=5.0, help="amplitude of the moves of --visual (default %(default)s)"
    )
    parser.add_argument(
        "--far-m", type=float, default=0.0, help="distance of the scene, from which --visual finds the pans' trims"
    )
    options = parser.parse_args(args)
    try:
        old = load_servos(options.servos) if options.servos.exists() else default_servos()
        joints = _chosen(options.joint, old)
        fresh = _visually(options, old, joints) if options.visual else _by_hand(options, old, joints)
        return _write(options, old | fresh)
    except (KeyboardInterrupt, EOFError):
        print("\nnothing was written", file=sys.stderr)
        return 1
    except (ValueError, OSError) as error:
        print(f"calibrate_servos: {error}", file=sys.stderr)
        return 2


def _chosen(asked: list[str] | None, servos: Mapping[str, ServoCalibration]) -> list[str]:
    for name in asked or []:
        if name not in servos:
            raise ServoCalibrationError(f"joint must be one of {', '.join(servos)}: got {name!r}")
    return list(asked or servos)


def _by_hand(
    options: argparse.Namespace, old: Mapping[str, ServoCalibration], joints: Sequence[str]
) -> dict[str, ServoCalibration]:
    terminal = Terminal()
    settings = _settings(options.set, options.backend)
    drivers = DriverSet(
        backends_of(old, joints, options.backend),
        lambda backend: {key: value for (name, key), value in settings.items() if name == backend.name},
        {name: old[name].channel for name in joints},
    )
    fresh = {}
    try:
        with terminal.keys():
            for name in joints:
                wired = f"{drivers.backends[name]} channel {old[name].channel}"
                terminal.print_line(f"\n{name}, {wired}, {old[name].model}: {_summary(old[name])}")
                terminal.print_line("Enter keeps it, c calibrates it")
                while (key := terminal.key()) not in ("enter", "c"):
                    continue
                found = _jog(terminal, drivers.by_joint[name], old[name]) if key == "c" else None
                if found is not None:
                    fresh[name] = found
    finally:
        drivers.close()
    return fresh


def _jog(terminal: Terminal, driver: ServoDriver, servo: ServoCalibration) -> ServoCalibration | None:
    session = JogSession(servo, partial(driver.set_pulse_us, servo.channel))
    marks: dict[str, Callable[[], None]] = {
        "[": session.mark_minimum,
        "]": session.mark_maximum,
        "0": session.mark_centre,
    }
    terminal.print_line(_HELP)
    message = ""
    try:
        while True:
            terminal.draw([*session.table(), message])
            message = ""
            key = terminal.key()
            try:
                if key == "escape":
                    return None
                if key == "enter":
                    return session.result()
                if key == "a":
                    session.mark_angle(terminal.line("joint angle here, in degrees (left and down positive): "))
                elif key == "r":
                    driver.release(servo.channel)
                    message = "released: the next move drives it again"
                elif key in marks:
                    marks[key]()
                else:
                    session.jog(key)
            except (ServoCalibrationError, DriverIoError) as error:
                message = str(error)
    finally:
        driver.release(servo.channel)


def _visually(
    options: argparse.Namespace, old: Mapping[str, ServoCalibration], joints: Sequence[str]
) -> dict[str, ServoCalibration]:
    # imported here, since the calibration by hand must work on a Pi without rclpy and OpenCV
    from vergence_calibration.ros.head_view import HeadView
    from vergence_calibration.servos.visual import VisualParameters, calibrate_head
    from vergence_rig.camera import CameraModel

    rig = load_rig(options.rig)
    parameters = VisualParameters(amplitude_deg=options.amplitude_deg, far_m=options.far_m)
    cameras = {"left": CameraModel(rig.left_camera), "right": CameraModel(rig.right_camera)}
    with HeadView(options.namespace) as head:
        cameras |= head.camera_models()
        chosen = {name: old[name] for name in joints}
        return calibrate_head(head, chosen, cameras, rig.baseline_m, parameters, print)


def _write(options: argparse.Namespace, servos: Mapping[str, ServoCalibration]) -> int:
    text = servo_file.as_text(servos)
    changes = backed_up_file.difference(options.servos, text)
    if not changes or (options.servos.exists() and load_servos(options.servos) == servos):
        print("nothing to change")
        return 0
    print(f"\n{changes}\n")
    if not options.yes:
        try:
            terminal = Terminal()
            with terminal.keys():
                answer = terminal.line(f"write {options.servos}? [y/N] ")
        except NoTerminalError:
            answer = ""
        if answer.lower() not in ("y", "yes"):
            print("nothing was written")
            return 1
    kept = backed_up_file.replace(options.servos, text)
    print(f"wrote {options.servos}" + (f"; the old one is {kept}" if kept else ""))
    return 0


def _settings(settings: Sequence[str], default: str) -> dict[tuple[str, str], Any]:
    values = {}
    for setting in settings:
        name, equals, text = setting.partition("=")
        if not equals:
            raise ServoCalibrationError(f"--set must be KEY=VALUE, a parameter of the servo driver: got {setting!r}")
        backend, _, key = name.rpartition(".")
        values[backend or default, key] = yaml.safe_load(text)
    return values


def _summary(servo: ServoCalibration) -> str:
    limits = f"{servo.minimum_us:.0f} to {servo.maximum_us:.0f} us"
    return f"centre {servo.pulse_us(0.0):.0f} us, {limits}, sign {servo.sign:+d}"


if __name__ == "__main__":
    sys.exit(main())
