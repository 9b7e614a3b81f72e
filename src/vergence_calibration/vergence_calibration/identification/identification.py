"""The whole identification: staircases of all axes, then, if the wiring is right, steps for the latencies."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from vergence_calibration.identification.axis_log import (
    EYES,
    AxisLog,
    EyeCamera,
    Head,
    IdentifyError,
    IdentifyParameters,
    stair_moves,
    step_moves,
)
from vergence_calibration.identification.latencies import Arrival, AxisTiming, Latencies, split
from vergence_calibration.identification.response import SEEN_BY, EyeGain, Response, eye_gain, motions, response
from vergence_calibration.identification.seen_motion import SeenMotion
from vergence_calibration.identification.step_timing import StepTiming, step_timing, steps_in
from vergence_calibration.identification.wiring_faults import cross_talk, wiring_faults
from vergence_calibration.lost_motion import staircase
from vergence_rig.rig import JOINT_NAMES

_LATEST_MARGIN_S = 0.05
_LEAST_REPORTED = 4


@dataclass(frozen=True)
class Identification:
    """The results, by joint and by eye."""

    responses: Mapping[str, Response]
    gains: Sequence[EyeGain]
    timings: Mapping[str, AxisTiming]
    arrivals: Mapping[str, Arrival]
    latencies: Latencies
    cameras: Mapping[str, EyeCamera]

    def gains_of(self, joint: str) -> list[EyeGain]:
        """Return the gains of one axis, in the eyes that it turns."""
        return [gain for gain in self.gains if gain.joint == joint]


def identify(
    head: Head, axes: Sequence[str], parameters: IdentifyParameters, assumption: str, progress: Callable[[str], None]
) -> Identification:
    """Move each axis a little and return the measured values.

    Args:
        head: at rest, commanded by no other node.
        axes: joint names, each once.
        parameters: how the axes are moved.
        assumption: how the lags are split; see `latencies`.
        progress: called with every line of progress.

    Raises:
        IdentifyError: an axis that cannot be identified, or a rig that is connected wrongly; a line for each fault.
    """
    for joint in axes:
        if joint not in JOINT_NAMES or list(axes).count(joint) > 1:
            raise IdentifyError(f"axes must be any of {', '.join(JOINT_NAMES)}, each once: got {', '.join(axes)}")
    if not axes:
        raise IdentifyError(f"axes must be any of {', '.join(JOINT_NAMES)}: got none")
    cameras = head.cameras()
    amplitude_rad = math.radians(parameters.amplitude_deg)
    stairs = stair_moves(staircase(amplitude_rad, parameters.stairs, 1), parameters.rest_s)
    responses, gains, timings = {}, [], {}
    seen: dict[str, dict[str, SeenMotion]] = {}
    logs = {}
    for joint in axes:
        progress(f"{joint}: {len(stairs)} stairs of {2 * parameters.amplitude_deg / parameters.stairs:.2f} degrees")
        log = head.record(joint, stairs)
        logs[joint], seen[joint] = log, motions(log, cameras)
        responses[joint] = response(log, seen[joint])
        log.frames.clear()  # a recording's pictures are many megabytes
    faults = wiring_faults(responses)
    if faults:
        raise IdentifyError("\n".join(faults))
    for joint in axes:
        for eye in SEEN_BY[joint]:
            gains.append(eye_gain(logs[joint], eye, seen[joint][eye], cameras[eye]))
            progress(f"  {_gain_in_words(gains[-1], responses[joint])}")
    steps = step_moves(amplitude_rad, parameters.steps, parameters.rest_s)
    for joint in axes:
        progress(f"{joint}: {parameters.steps} steps of {2 * parameters.amplitude_deg:g} degrees")
        log = head.record(joint, steps)
        seen[f"{joint} steps"] = motions(log, cameras)
        timings[joint] = axis_timing(log, seen[f"{joint} steps"], parameters.rest_s - _LATEST_MARGIN_S)
        log.frames.clear()
        for eye, timing in timings[joint].seen.items():
            progress(f"  {joint}: seen by the {eye} eye {_timing_in_words(timing)}")
    arrivals = {eye: _arrival([motion[eye] for motion in seen.values()]) for eye in EYES}
    return Identification(responses, gains, timings, arrivals, split(timings, arrivals, assumption), cameras)


def axis_timing(log: AxisLog, seen: Mapping[str, SeenMotion], latest_s: float) -> AxisTiming:
    """Return the timing of a recording of steps. Raises IdentifyError."""
    timings = {}
    for eye in SEEN_BY[log.joint]:
        values = seen[eye].tilt_rad if log.joint == "tilt" else seen[eye].pan_rad
        steps = steps_in(log.commands, seen[eye].stamps_s, values, latest_s)
        timings[eye] = step_timing(steps, latest_s, f"{log.joint}, {eye} eye")
    shown = steps_in(log.commands, log.reports[:, 0], log.reports[:, 1], latest_s)
    # where the driver reports no motion, the cameras' timing is still used
    enough = len(shown) >= max(0.5 * len(steps), _LEAST_REPORTED)
    reported = step_timing(shown, latest_s, f"{log.joint}, joint_states") if enough else None
    return AxisTiming(log.joint, timings, reported)


def _arrival(recordings: Sequence[SeenMotion]) -> Arrival:
    wait_s = np.concatenate([motion.arrivals_s - motion.stamps_s for motion in recordings])
    interval_s = np.concatenate([np.diff(motion.stamps_s) for motion in recordings])
    return Arrival(float(np.median(wait_s)), float(np.percentile(wait_s, 95)), float(np.median(interval_s)))


def _gain_in_words(gain: EyeGain, found: Response) -> str:
    return (
        f"{gain.joint}: sign +1, {gain.px_per_rad:.1f} +- {gain.px_per_rad_sigma:.1f} px per radian in the {gain.eye} "
        f"eye ({gain.deviation:+.1%} of its focal length), lost motion {math.degrees(gain.loop.lost):.2f} +- "
        f"{math.degrees(gain.loop.lost_sigma):.2f} degrees, cross-talk {cross_talk(found):.1%}"
    )


def _timing_in_words(timing: StepTiming) -> str:
    speed = (
        f"{math.degrees(timing.speed_rad_s):.0f} degrees/s" if timing.speed_known else "too fast to measure its speed"
    )
    return (
        f"{1e3 * timing.onset_s:.1f} +- {1e3 * timing.onset_sigma_s:.1f} ms after the command "
        f"(varies by {1e3 * timing.jitter_s:.1f}), {speed}"
    )
