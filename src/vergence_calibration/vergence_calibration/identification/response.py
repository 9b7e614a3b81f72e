"""The response of both eyes to the moves of one axis: gains, lost motion and cross-talk."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vergence_calibration.identification.axis_log import EYES, AxisLog, EyeCamera, IdentifyError
from vergence_calibration.identification.seen_motion import SeenMotion, seen_motion, settled
from vergence_calibration.lost_motion import Loop, LoopError, fit_loop

Array = npt.NDArray[np.float64]

SEEN_BY = {"pan_left": ("left",), "pan_right": ("right",), "tilt": EYES}
"""The eyes that an axis turns if the wiring is right."""

_LEAST_AGREEMENT = 0.6
_MOST_RESIDUAL = 0.2
# Without a calibrated camera the focal length is uncertain too.
_GAINS = {True: (0.75, 1.25), False: (0.4, 2.5)}


@dataclass(frozen=True)
class Response:
    """Slopes of seen over commanded angle, (2, 2): eyes left and right, pan and tilt.

    `unrelated_rad` (2, 2) is the RMS residual: the servo's backlash, and things that move by themselves.
    """

    joint: str
    amplitude_rad: float
    slopes: Array
    unrelated_rad: Array


@dataclass(frozen=True)
class EyeGain:
    """Gain of an axis in one eye: seen per commanded angle, and in pixels at the image's centre per radian commanded.

    `fx_px` is the focal length of camera_info (or the rig) along the axis's direction: the pixels per radian of a joint
    that turns exactly as commanded.
    """

    joint: str
    eye: str
    loop: Loop
    fx_px: float

    @property
    def px_per_rad(self) -> float:
        """Pixels per radian commanded."""
        return abs(self.loop.gain) * self.fx_px

    @property
    def px_per_rad_sigma(self) -> float:
        """Standard deviation of `px_per_rad`."""
        return self.loop.gain_sigma * self.fx_px

    @property
    def deviation(self) -> float:
        """Relative difference of `px_per_rad` from the focal length."""
        return abs(self.loop.gain) - 1.0


def motions(log: AxisLog, cameras: Mapping[str, EyeCamera]) -> dict[str, SeenMotion]:
    """Return both eyes' motion in a recording. Raises IdentifyError."""
    seen = {}
    for eye in EYES:
        where = f"{log.joint}, {eye} eye"
        seen[eye] = seen_motion(log.frames[eye], cameras[eye].model, where)
        agreement = float(np.nanmedian(seen[eye].agreement))
        if agreement < _LEAST_AGREEMENT:
            raise IdentifyError(
                f"{where}: {_LEAST_AGREEMENT:.0%} or more of the features must move together: got {agreement:.0%}; "
                "something moves in view"
            )
    return seen


def response(log: AxisLog, seen: Mapping[str, SeenMotion]) -> Response:
    """Return the slopes of a staircase. Raises IdentifyError where too few rests were seen."""
    stamps_s, commanded_rad = log.commands[:, 0], log.commands[:, 1]
    slopes, unrelated = np.zeros((2, 2)), np.zeros((2, 2))
    for row, eye in enumerate(EYES):
        for column, values in enumerate((seen[eye].pan_rad, seen[eye].tilt_rad)):
            rests = settled(seen[eye].stamps_s, values, stamps_s)
            slopes[row, column], unrelated[row, column] = _slope(commanded_rad, rests, f"{log.joint}, {eye} eye")
    return Response(log.joint, 0.5 * float(np.ptp(commanded_rad)), slopes, unrelated)


def _slope(commanded_rad: Array, seen_rad: Array, where: str) -> tuple[float, float]:
    known = np.isfinite(seen_rad)
    if known.sum() < max(8, 0.6 * len(commanded_rad)):
        raise IdentifyError(
            f"{where}: it must be seen at rest after 60 % or more of {len(commanded_rad)} moves: got {int(known.sum())}"
        )
    commanded, seen = commanded_rad[known] - commanded_rad[known].mean(), seen_rad[known] - seen_rad[known].mean()
    slope = float(commanded @ seen / (commanded @ commanded))
    return slope, float(np.sqrt(np.mean((seen - slope * commanded) ** 2)))


def eye_gain(log: AxisLog, eye: str, seen: SeenMotion, camera: EyeCamera) -> EyeGain:
    """Return how far a staircase of this axis turns one eye.

    Raises IdentifyError where the eye does not follow the commands, or its gain is implausible.
    """
    where = f"{log.joint}, {eye} eye"
    values = seen.tilt_rad if log.joint == "tilt" else seen.pan_rad
    rests = settled(seen.stamps_s, values, log.commands[:, 0])
    known = np.isfinite(rests)
    try:
        loop = fit_loop(log.commands[known, 1], rests[known])
    except LoopError as error:
        raise IdentifyError(f"{where}: {error} (--amplitude-deg)") from None
    spread_rad = float(np.ptp(log.commands[:, 1]))
    if loop.residual > _MOST_RESIDUAL * spread_rad:
        raise IdentifyError(
            f"{where}: seen and commanded angles must agree to {math.degrees(_MOST_RESIDUAL * spread_rad):.2f} "
            f"degrees: got {math.degrees(loop.residual):.2f}; does something move in view?"
        )
    gain = EyeGain(log.joint, eye, loop, camera.model.fy_px if log.joint == "tilt" else camera.model.fx_px)
    low, high = _GAINS[camera.calibrated]
    if not low <= abs(loop.gain) <= high:
        raise IdentifyError(
            f"{where}: px per radian commanded must be {low * gain.fx_px:.0f} to {high * gain.fx_px:.0f}, near the "
            f"focal length of {gain.fx_px:.0f} px: got {gain.px_per_rad:.0f}; run `calibrate_servos --visual` for "
            f"{log.joint}, or `vergence calibrate cameras`"
        )
    return gain
