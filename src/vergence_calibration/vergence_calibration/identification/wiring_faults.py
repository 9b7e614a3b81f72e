"""Checks that every axis turns the right eye in the right direction, and says what to change where not."""

import math
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from vergence_calibration.identification.axis_log import EYES
from vergence_calibration.identification.response import Response

Array = npt.NDArray[np.float64]

_LEAST_SLOPE = 0.15
_MOST_CROSS_TALK = 0.2
_LEAST_SIMILARITY = 0.9
_MOST_UNRELATED, _UNRELATED_BACKLASH_RAD = 0.4, math.radians(0.3)

# Rows: left and right eye; columns: pan and tilt.
_PATTERNS: dict[str, Array] = {
    "pan_left": np.array([[1.0, 0.0], [0.0, 0.0]]),
    "pan_right": np.array([[0.0, 0.0], [1.0, 0.0]]),
    "tilt": np.array([[0.0, 1.0], [0.0, 1.0]]),
    "left on its side": np.array([[0.0, 1.0], [0.0, 0.0]]),
    "right on its side": np.array([[0.0, 0.0], [0.0, 1.0]]),
    "both pan": np.array([[1.0, 0.0], [1.0, 0.0]]),
    "one eye upside down": np.array([[0.0, 1.0], [0.0, -1.0]]),
}
_DIRECTIONS = {"pan_left": ("left", "right"), "pan_right": ("left", "right"), "tilt": ("down", "up")}


def wiring_faults(responses: Mapping[str, Response]) -> list[str]:
    """Return one sentence for each fault of connection or mounting; none if all is right."""
    found = {joint: _pattern(response) for joint, response in responses.items()}
    upside_down = _upside_down(responses, found)
    lines = []
    for joint, response in responses.items():
        line = _of_one(joint, response, *found[joint], upside_down)
        if line:
            lines.append(line)
    swapped = [joint for joint in ("pan_left", "pan_right") if _is_swapped(joint, found.get(joint))]
    if swapped:
        lines.insert(0, _swap(swapped, responses))
    if upside_down:
        lines.insert(
            0, f"the {upside_down} camera is mounted upside down: its image moves the wrong way in both directions"
        )
    return lines


def cross_talk(response: Response) -> float:
    """Return the largest slope of the other directions, relative to the axis's own."""
    own = _PATTERNS[response.joint] > 0
    return float(np.abs(response.slopes[~own]).max() / np.abs(response.slopes[own]).mean())


def _pattern(response: Response) -> tuple[str, int]:
    """Return the most similar pattern and its sign; "" if none is similar, "still" if nothing moves."""
    slopes = response.slopes
    size = float(np.linalg.norm(slopes))
    if float(np.abs(slopes).max()) < _LEAST_SLOPE:
        return "still", 0
    similarity = {name: float((slopes * p).sum()) / size / float(np.linalg.norm(p)) for name, p in _PATTERNS.items()}
    best = max(similarity, key=lambda name: abs(similarity[name]))
    if abs(similarity[best]) < _LEAST_SIMILARITY:
        return "", 0
    return best, 1 if similarity[best] > 0 else -1


def _upside_down(responses: Mapping[str, Response], found: Mapping[str, tuple[str, int]]) -> str:
    """Return the eye that is upside down: tilt turns the two opposite ways, and its own pan is the wrong way too."""
    if found.get("tilt", ("", 0))[0] != "one eye upside down":
        return ""
    return EYES[int(np.argmin(responses["tilt"].slopes[:, 1]))]


def _is_swapped(joint: str, found: tuple[str, int] | None) -> bool:
    return found is not None and found[0] in ("pan_left", "pan_right") and found[0] != joint


def _swap(joints: list[str], responses: Mapping[str, Response]) -> str:
    moved = " and ".join(
        f"{joint} moves the {'right' if joint == 'pan_left' else 'left'} image "
        f"({_told(responses[joint], _PATTERNS['pan_right' if joint == 'pan_left' else 'pan_left'])})"
        for joint in joints
    )
    return (
        f"{moved}: the cameras or the pan servos are swapped; exchange left_device and right_device of the cameras, or "
        "the channels of pan_left and pan_right in servos.yaml (the images cannot show which of the two)"
    )


def _of_one(joint: str, response: Response, pattern: str, sign: int, upside_down: str) -> str:
    reach = f"commanded {math.degrees(response.amplitude_rad):+.1f} degrees"
    unrelated_rad = float(response.unrelated_rad.max())
    allowed_rad = _MOST_UNRELATED * response.amplitude_rad + _UNRELATED_BACKLASH_RAD
    if unrelated_rad > allowed_rad:
        return (
            f"the images' motion while {joint} moves must follow it to {math.degrees(allowed_rad):.1f} degrees: got "
            f"{math.degrees(unrelated_rad):.1f}; something moves in view, or the whole head does"
        )
    if pattern == "still":
        most = float(np.abs(response.slopes).max())
        return (
            f"{joint} does not move the images: {reach}, the eyes must turn by {_LEAST_SLOPE:.0%} or more of it: got "
            f"{most:.0%}; is its servo powered, enabled, plugged in and free to move?"
        )
    if pattern.endswith("on its side"):
        return f"{joint} moves the {pattern.split()[0]} image up and down: that camera is mounted on its side"
    if pattern == "both pan":
        return f"{joint} turns both eyes to the side: its servo turns the whole head, or both topics show one camera"
    if _is_swapped(joint, (pattern, sign)) and joint != "tilt":
        return ""  # reported for both pans at once
    if pattern == "one eye upside down":
        return "" if upside_down and joint == "tilt" else _unclear(joint, response, reach)
    if pattern == "":
        return _unclear(joint, response, reach)
    if pattern != joint:
        return (
            f"{joint} moves the eyes as {pattern} should: exchange the channels of {joint} and {pattern} in servos.yaml"
        )
    if sign < 0 and joint != f"pan_{upside_down}":
        way, other = _DIRECTIONS[joint]
        return (
            f"{joint} turns the wrong way: {_told(response, _PATTERNS[joint])}, {other} instead of {way}; set "
            f"`sign: -1` for {joint} in servos.yaml (`sign: 1` if it is -1 now)"
        )
    talk = cross_talk(response)
    if talk > _MOST_CROSS_TALK:
        return (
            f"{joint} must turn an eye in other directions by at most {_MOST_CROSS_TALK:.0%} of its own motion: got "
            f"{talk:.0%}; is a camera rolled, or something loose?"
        )
    return ""


def _unclear(joint: str, response: Response, reach: str) -> str:
    (left_pan, left_tilt), (right_pan, right_tilt) = np.degrees(response.slopes * response.amplitude_rad)
    return (
        f"{joint} moves the eyes as no axis of this head should: {reach}, the left eye turned {left_pan:+.1f} left and "
        f"{left_tilt:+.1f} down, the right {right_pan:+.1f} left and {right_tilt:+.1f} down; are the cameras upright, "
        "and does nothing move in view?"
    )


def _told(response: Response, pattern: Array) -> str:
    seen = float((response.slopes * pattern).sum() / pattern.sum())
    amplitude = math.degrees(response.amplitude_rad)
    return f"commanded {amplitude:+.1f} degrees, seen {seen * amplitude:+.1f}"
