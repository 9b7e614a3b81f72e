"""The goal of `vergence look`: options of the command line to the fields of a LookAt goal, and the lines it prints."""

import argparse
import math
from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class LookRequest:
    """One goal.

    Attributes:
        kind: name of the kind in LookAt.action.
        text: what is looked at, for the terminal.
        fields: values of the goal's fields by name [m, px, rad].
        point_m: the point of a POINT goal [m].
        frame: frame of that point.
    """

    kind: str
    text: str
    fields: Mapping[str, float | int | str]
    point_m: tuple[float, float, float] | None = None
    frame: str = ""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `vergence look`."""
    target = parser.add_mutually_exclusive_group(required=True)
    target.add_argument("--pixel", nargs=2, type=_finite, metavar=("X", "Y"), help="pixel of one eye's image")
    target.add_argument(
        "--stereo", nargs=4, type=_finite, metavar=("LX", "LY", "RX", "RY"), help="pixels of one point in both images"
    )
    target.add_argument("--class", dest="class_name", metavar="NAME", help="class of the detector of box_metric_node")
    target.add_argument("--point", nargs=3, type=_finite, metavar=("X", "Y", "Z"), help="point in --frame [m]")
    target.add_argument(
        "--angles",
        nargs=3,
        type=_finite,
        metavar=("VERSION", "VERGENCE", "TILT"),
        help="absolute angles [degrees]; version > 0 is to the left, tilt > 0 down",
    )
    target.add_argument(
        "--turn",
        nargs=3,
        type=_finite,
        metavar=("VERSION", "VERGENCE", "TILT"),
        help="angles that are added to the present ones [degrees]",
    )
    target.add_argument("--motion", action="store_true", help="whatever moves next in the left image")
    parser.add_argument("--eye", choices=("left", "right"), default="left", help="eye of --pixel (default: left)")
    parser.add_argument("--depth", type=_positive, metavar="M", help="distance along the eye's ray of --pixel [m]")
    parser.add_argument("--frame", default="rig_base", help="frame of --point (default: %(default)s)")
    parser.add_argument(
        "--time-limit", type=_positive, default=0.0, metavar="S", help="of the goal (default: the controller's own)"
    )
    parser.add_argument("--namespace", default="", help="namespace of the head (default: none)")
    parser.add_argument(
        "--wait", type=_positive, default=10.0, metavar="S", help="longest wait for the controller (default: 10)"
    )


def look_request(options: argparse.Namespace) -> LookRequest:
    """Return the goal of these options. Raises ValueError."""
    if options.class_name == "":
        raise ValueError("--class must be the name of a class of the detector: got an empty string")
    if options.depth is not None and options.pixel is None:
        raise ValueError("--depth is the distance of --pixel: it needs one")
    if options.pixel is not None:
        x, y = options.pixel
        eye = options.eye
        fields = {"eye": int(eye == "right"), f"{eye}_x_px": x, f"{eye}_y_px": y, "depth_m": options.depth or math.nan}
        return LookRequest("PIXEL", f"pixel ({x:g}, {y:g}) of the {eye} eye", fields)
    if options.stereo is not None:
        of_pixels = ("left_x_px", "left_y_px", "right_x_px", "right_y_px")
        lx, ly, rx, ry = options.stereo
        text = f"pixels ({lx:g}, {ly:g}) of the left and ({rx:g}, {ry:g}) of the right eye"
        return LookRequest("STEREO_PIXEL", text, dict(zip(of_pixels, options.stereo, strict=True)))
    if options.class_name is not None:
        return LookRequest("CLASS", f"a target of class {options.class_name}", {"class_name": options.class_name})
    if options.point is not None:
        x, y, z = options.point
        text = f"point ({x:g}, {y:g}, {z:g}) m in {options.frame}"
        return LookRequest("POINT", text, {}, (x, y, z), options.frame)
    if options.motion:
        return LookRequest("MOTION", "whatever moves next", {})
    relative = options.turn is not None
    angles = options.turn if relative else options.angles
    version, vergence, tilt = angles
    text = f"version {version:g}, vergence {vergence:g}, tilt {tilt:g} degrees" + " from here" * relative
    names = ("version_rad", "vergence_rad", "tilt_rad")
    return LookRequest(
        "RELATIVE_ANGLES" if relative else "ANGLES", text, dict(zip(names, map(math.radians, angles), strict=True))
    )


def feedback_line(phase: str, residuals_deg: tuple[float, float, float], contrast: float) -> str:
    """Return one line of progress: the phase, what is left to turn by axis, and the contrast; "-" where unknown."""
    version, vergence, tilt = (_figure(value, "+.2f") for value in residuals_deg)
    left = f"to turn: version {version}, vergence {vergence}, tilt {tilt} deg"
    return f"{phase:<8} {left}; contrast {_figure(contrast, '.2f')}"


def result_line(
    name: str,
    time_s: float,
    reason: str,
    fixation_m: tuple[float, float, float],
    frame: str,
    vergence_rad: float,
    distance: str = "",
) -> str:
    """Return the line of a result: its name, the reason, where the eyes look, and the target's distance in words."""
    because = f": {reason}" if reason else ""
    place = ""
    if all(map(math.isfinite, fixation_m)):
        x, y, z = fixation_m
        degrees = _figure(math.degrees(vergence_rad), ".2f")
        place = f"\nthe eyes look at ({x:.3f}, {y:.3f}, {z:.3f}) m in {frame or 'rig_base'}, vergence {degrees} deg"
    if distance:
        place += f"\nthe target's distance, with its interval of 95 %: {distance}"
    return f"{name} after {time_s:.2f} s{because}{place}"


def _figure(value: float, form: str) -> str:
    return format(value, form) if math.isfinite(value) else "-"


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"must be a number: got {text}")
    return value


def _positive(text: str) -> float:
    value = _finite(text)
    if value <= 0:
        raise argparse.ArgumentTypeError(f"must be above 0: got {text}")
    return value
