"""What each eye sees when one axis is told to move: gains, play, and what else turns along with it."""

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
"""The eyes that an axis turns, when all is connected as it should be."""

_LEAST_AGREEMENT = 0.6
_MOST_RESIDUAL = 0.2
# With a calibrated camera only the servo can be wrong; without, its focal length is only a guess.
_GAINS = {True: (0.75, 1.25), False: (0.4, 2.5)}


@dataclass(frozen=True)
class Response:
    """Slopes of what was seen over what was told, (2, 2): eyes left and right, pan and tilt.

    `unrelated_rad` (2, 2) is what else moved, root mean square: the play of the servo, and whatever moves by itself.
    """

    joint: str
    amplitude_rad: float
    slopes: Array
    unrelated_rad: Array


@dataclass(frozen=True)
class EyeGain:
    """How far an axis turns one eye: seen per told, and in pixels at the image's centre per radian told.

    `fx_px` is the focal length that camera_info (or the rig) says, along the axis's own direction: what a joint that
    turns exactly as far as it is told would show.
    """

    joint: str
    eye: str
    loop: Loop
    fx_px: float

    @property
    def px_per_rad(self) -> float:
        """Pixels per radian told."""
        return abs(self.loop.gain) * self.fx_px

    @property
    def px_per_rad_sigma(self) -> float:
        """Its standard deviation."""
        return self.loop.gain_sigma * self.fx_px

    @property
    def deviation(self) -> float:
        """By what share that is more than the focal length."""
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
                f"{where}: only {agreement:.0%} of what it sees moves together: allowed is {_LEAST_AGREEMENT:.0%} or "
                "more; something moves in view"
            )
    return seen


def response(log: AxisLog, seen: Mapping[str, SeenMotion]) -> Response:
    """Return the slopes of a staircase. Raises IdentifyError where too few rests were seen."""
    stamps_s, told_rad = log.commands[:, 0], log.commands[:, 1]
    slopes, unrelated = np.zeros((2, 2)), np.zeros((2, 2))
    for row, eye in enumerate(EYES):
        for column, values in enumerate((seen[eye].pan_rad, seen[eye].tilt_rad)):
            rests = settled(seen[eye].stamps_s, values, stamps_s)
            slopes[row, column], unrelated[row, column] = _slope(told_rad, rests, f"{log.joint}, {eye} eye")
    return Response(log.joint, 0.5 * float(np.ptp(told_rad)), slopes, unrelated)


def _slope(told_rad: Array, seen_rad: Array, where: str) -> tuple[float, float]:
    known = np.isfinite(seen_rad)
    if known.sum() < max(8, 0.6 * len(told_rad)):
        raise IdentifyError(
            f"{where}: it was seen at rest after {int(known.sum())} of {len(told_rad)} moves: allowed is 60 % or more"
        )
    told, seen = told_rad[known] - told_rad[known].mean(), seen_rad[known] - seen_rad[known].mean()
    slope = float(told @ seen / (told @ told))
    return slope, float(np.sqrt(np.mean((seen - slope * told) ** 2)))


def eye_gain(log: AxisLog, eye: str, seen: SeenMotion, camera: EyeCamera) -> EyeGain:
    """Return how far a staircase of this axis turns one eye.

    Raises IdentifyError where what is seen does not follow, or is too far from what was told.
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
            f"{where}: what is seen is {math.degrees(loop.residual):.2f} degrees off what was told: allowed is "
            f"{math.degrees(_MOST_RESIDUAL * spread_rad):.2f}; does something move in view?"
        )
    gain = EyeGain(log.joint, eye, loop, camera.model.fy_px if log.joint == "tilt" else camera.model.fx_px)
    low, high = _GAINS[camera.calibrated]
    if not low <= abs(loop.gain) <= high:
        raise IdentifyError(
            f"{where}: {gain.px_per_rad:.0f} px per radian told: allowed is {low * gain.fx_px:.0f} to "
            f"{high * gain.fx_px:.0f}, near the focal length of {gain.fx_px:.0f} px; run "
            f"`calibrate_servos --visual` for {log.joint}, or `vergence calibrate cameras`"
        )
    return gain
