"""Calibrates all servos of a head from its cameras' images while each axis moves a little."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from vergence_calibration.eye_turn import Image, azimuth_difference, eye_turn
from vergence_calibration.lost_motion import staircase
from vergence_calibration.servos.axis_response import AxisResponse, axis_response, calibrated
from vergence_rig.camera import CameraModel
from vergence_rig.parameters import Parameters, parameter
from vergence_servo.calibration import ServoCalibration, ServoCalibrationError

_EYES_OF_JOINT = {"pan_left": ("left",), "pan_right": ("right",), "tilt": ("left", "right")}


@dataclass(frozen=True)
class VisualParameters(Parameters):
    """How each axis is moved."""

    amplitude_deg: float = parameter(
        5.0, "amplitude of the staircase in either direction", unit="degrees", minimum=1, maximum=15
    )
    steps: int = parameter(10, "steps of the staircase in each direction", minimum=4, maximum=40)
    loops: int = parameter(1, "repetitions of the staircase", minimum=1, maximum=10)
    far_m: float = parameter(
        0.0,
        "distance of the scene, from which the pans' trims follow; 0 leaves the trims unchanged",
        unit="m",
        minimum=0,
    )


class Head(Protocol):
    """A head whose joints can be commanded and whose images can be read."""

    def look(self, joints_rad: Mapping[str, float]) -> Mapping[str, Image]:
        """Command the joints [rad], wait until they rest, and return both eyes' images by "left" and "right"."""


def calibrate_axis(
    head: Head,
    joint: str,
    servo: ServoCalibration,
    cameras: Mapping[str, CameraModel],
    parameters: VisualParameters,
    progress: Callable[[str], None],
) -> AxisResponse:
    """Move one joint in a staircase and return its response. Raises ServoCalibrationError, NoMotionSeenError."""
    rest = dict.fromkeys(_EYES_OF_JOINT, 0.0)
    reference = head.look(rest)
    pulses_us: list[float] = []
    seen_rad: list[float] = []
    for angle_rad in staircase(math.radians(parameters.amplitude_deg), parameters.steps, parameters.loops):
        images = head.look(rest | {joint: angle_rad})
        turns = [eye_turn(reference[eye], images[eye], cameras[eye]) for eye in _EYES_OF_JOINT[joint]]
        seen = [turn.tilt_rad if joint == "tilt" else turn.pan_rad for turn in turns]
        pulses_us.append(servo.pulse_us(angle_rad))
        seen_rad.append(float(np.mean(seen)))
        progress(
            f"  {joint}: commanded {math.degrees(angle_rad):+6.2f}, seen {math.degrees(seen_rad[-1]):+6.2f} degrees"
        )
    return axis_response(pulses_us, seen_rad)


def pan_offsets_rad(
    head: Head, cameras: Mapping[str, CameraModel], baseline_m: float, far_m: float
) -> dict[str, float]:
    """Return each pan's true angle when both are commanded to 0: half of the measured difference each.

    The scene must be about `far_m` away. The common part, and the tilt's offset, cannot be measured without a mark.
    """
    images = head.look(dict.fromkeys(_EYES_OF_JOINT, 0.0))
    apart_rad = azimuth_difference(images["left"], images["right"], cameras["left"], cameras["right"])
    apart_rad -= 2 * math.atan(0.5 * baseline_m / far_m)
    return {"pan_left": 0.5 * apart_rad, "pan_right": -0.5 * apart_rad}


def calibrate_head(
    head: Head,
    servos: Mapping[str, ServoCalibration],
    cameras: Mapping[str, CameraModel],
    baseline_m: float,
    parameters: VisualParameters,
    progress: Callable[[str], None],
) -> dict[str, ServoCalibration]:
    """Return new calibrations of the joints in `servos`. Raises ServoCalibrationError, NoMotionSeenError."""
    for joint in servos:
        if joint not in _EYES_OF_JOINT:
            raise ServoCalibrationError(f"joint must be one of {', '.join(_EYES_OF_JOINT)}: got {joint!r}")
    responses = {
        joint: calibrate_axis(head, joint, servo, cameras, parameters, progress) for joint, servo in servos.items()
    }
    offsets = pan_offsets_rad(head, cameras, baseline_m, parameters.far_m) if parameters.far_m > 0 else {}
    fresh = {}
    for joint, response in responses.items():
        fresh[joint] = calibrated(servos[joint], response, offsets.get(joint, 0.0))
        progress(f"{joint}: {_in_words(response)}, trim {math.degrees(offsets.get(joint, 0.0)):+.2f} degrees")
    return fresh


def _in_words(response: AxisResponse) -> str:
    return (
        f"sign {response.sign:+d}, {math.degrees(response.gain_rad_per_us):.4f} degrees per us, "
        f"lost motion {math.degrees(response.lost_motion_rad):.2f} degrees, "
        f"residual {math.degrees(response.residual_rad):.3f} degrees"
    )
