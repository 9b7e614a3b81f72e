"""Latency and speed of steps that a camera, or a driver, samples coarsely.

A step of a hobby servo ends within a frame or two, so one step gives its time only to a frame interval. Many steps, at
many phases of the frames, give it to a millisecond: the posterior of onset, speed and jitter is computed on a grid,
where every step has its own latency about a common one (a servo reads its pulse only every 20 ms). The model includes
outliers.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vergence_calibration.identification.axis_log import IdentifyError

Array = npt.NDArray[np.float64]

_STEP_S = 0.001
_EARLIEST_S = -0.05
_SPEEDS_RAD_S = np.geomspace(0.5, 64.0, 29)
_JITTERS_S = np.array([0.0005, 0.001, 0.002, 0.004, 0.007, 0.012, 0.02, 0.04, 0.08])
_LEAST_STEPS = 4
_SLACK = 0.03
_OUTLIER_FRAME, _OUTLIER_STEP = 0.02, 0.03


@dataclass(frozen=True)
class Step:
    """One step: its length [rad], and how much of it was done, (n,) from 0 to 1, at times since its command [s]."""

    length_rad: float
    since_s: Array
    done: Array
    sigma: float


@dataclass(frozen=True)
class StepTiming:
    """Latency from the command to the first motion (onset) and to half of it (middle), with standard deviations.

    `jitter_s` is how much the latency varies from step to step; the speed is the motion's, `speed_known` if the frames
    were dense enough to measure it.
    """

    onset_s: float
    onset_sigma_s: float
    middle_s: float
    middle_sigma_s: float
    speed_rad_s: float
    speed_sigma_rad_s: float
    jitter_s: float
    steps: int

    @property
    def speed_known(self) -> bool:
        """True if the speed is known to a fifth."""
        return self.speed_sigma_rad_s < 0.2 * self.speed_rad_s


def steps_in(commands: Array, stamps_s: Array, values_rad: Array, latest_s: float) -> list[Step]:
    """Cut a signal into its steps, each normalised by the rests before and after it.

    Args:
        commands: (n, 2) stamps [s] and angles [rad], in order; steps shorter than half the longest are left out.
        stamps_s: (m,) of the signal, increasing.
        values_rad: (m,) the signal [rad]; NaN where it is missing.
        latest_s: samples until so long after a command are its step's [s].
    """
    known = np.isfinite(values_rad)
    stamps_s, values_rad = stamps_s[known], values_rad[known]
    commanded = np.diff(commands[:, 1])
    longest_rad = float(np.abs(commanded).max(initial=0.0))
    steps = []
    for k in range(len(commanded)):
        begin_s = commands[k + 1, 0]
        end_s = commands[k + 2, 0] if k + 2 < len(commands) else stamps_s[-1] + _STEP_S if len(stamps_s) else begin_s
        before = values_rad[(stamps_s > commands[k, 0]) & (stamps_s < begin_s)][-3:]
        after = values_rad[(stamps_s > begin_s) & (stamps_s < end_s)][-3:]
        if abs(commanded[k]) < 0.5 * longest_rad or len(before) < 2 or len(after) < 2:
            continue
        low, high = float(np.median(before)), float(np.median(after))
        if abs(high - low) < 0.3 * abs(commanded[k]):
            continue
        inside = (stamps_s > begin_s + _EARLIEST_S) & (stamps_s < min(end_s, begin_s + latest_s))
        scatter = max(float(np.ptp(before)), float(np.ptp(after))) / abs(high - low)
        done = (values_rad[inside] - low) / (high - low)
        steps.append(Step(abs(high - low), stamps_s[inside] - begin_s, done, float(np.hypot(_SLACK, 0.5 * scatter))))
    return steps


def step_timing(steps: Sequence[Step], latest_s: float, what: str) -> StepTiming:
    """Return the common latency and speed of several steps.

    Args:
        steps: at least four; better a dozen, at different phases of the samples.
        latest_s: the longest latency considered [s].
        what: the subject of the error, such as "pan_left, left eye".

    Raises:
        IdentifyError: too few steps, or a latency outside the considered range.
    """
    if len(steps) < _LEAST_STEPS:
        raise IdentifyError(
            f"{what}: {_LEAST_STEPS} or more whole steps must be seen: got {len(steps)} (do images come?)"
        )
    onsets_s = np.arange(_EARLIEST_S, latest_s + 0.5 * _STEP_S, _STEP_S)
    single = np.stack([_likelihood(step, onsets_s) for step in steps])  # (steps, speeds, onsets)
    logs = np.stack([_joint(single, jitter_s) for jitter_s in _JITTERS_S])  # (jitters, speeds, onsets)
    weights = np.exp(logs - logs.max())
    weights /= weights.sum()
    # close to the ends of the range the posterior is cut off: no valid estimate
    by_onset = weights.sum(axis=(0, 1))
    edge = max(int(0.01 / _STEP_S), 1)
    if by_onset[-edge:].sum() > 0.1 or by_onset[:edge].sum() > 0.1:
        raise IdentifyError(
            f"{what}: the motion must come {1e3 * _EARLIEST_S:.0f} to {1e3 * latest_s:.0f} ms after its command: got "
            f"{1e3 * float(by_onset @ onsets_s):+.0f} ms (do the machines' clocks agree?)"
        )
    length_rad = float(np.median([step.length_rad for step in steps]))
    middles_s = onsets_s[None, :] + 0.5 * length_rad / _SPEEDS_RAD_S[:, None]
    by_pair = weights.sum(axis=0)
    onset_s, onset_sigma_s = _moments(onsets_s, by_onset)
    middle_s, middle_sigma_s = _moments(middles_s.ravel(), by_pair.ravel())
    log_speed, log_speed_sigma = _moments(np.log(_SPEEDS_RAD_S), by_pair.sum(axis=1))
    spacing = float(np.log(_SPEEDS_RAD_S[1] / _SPEEDS_RAD_S[0]))
    speed_rad_s = float(np.exp(log_speed))
    return StepTiming(
        onset_s=onset_s,
        onset_sigma_s=float(np.hypot(onset_sigma_s, _STEP_S)),
        middle_s=middle_s,
        middle_sigma_s=float(np.hypot(middle_sigma_s, _STEP_S)),
        speed_rad_s=speed_rad_s,
        speed_sigma_rad_s=speed_rad_s * float(np.hypot(log_speed_sigma, 0.5 * spacing)),
        jitter_s=float(weights.sum(axis=(1, 2)) @ _JITTERS_S),
        steps=len(steps),
    )


def _likelihood(step: Step, onsets_s: Array) -> Array:
    """Return the likelihood of each speed and onset, (speeds, onsets), scaled to a maximum of 1."""
    durations_s = step.length_rad / _SPEEDS_RAD_S
    total = np.zeros((len(_SPEEDS_RAD_S), len(onsets_s)))
    for since_s, done in zip(step.since_s, step.done, strict=True):
        expected = np.clip((since_s - onsets_s)[None, :] / durations_s[:, None], 0.0, 1.0)
        miss = (done - expected) / step.sigma
        total += np.log((1.0 - _OUTLIER_FRAME) * np.exp(-0.5 * miss * miss) + _OUTLIER_FRAME * step.sigma)
    scaled: Array = np.exp(total - total.max())
    return scaled


def _joint(single: Array, jitter_s: float) -> Array:
    """Return the log posterior (speeds, onsets) if every step's latency varies by `jitter_s` about the common one."""
    reach = min(int(np.ceil(4.0 * jitter_s / _STEP_S)), (single.shape[-1] - 1) // 2)  # "same" is of the longer one
    offsets = np.arange(-reach, reach + 1) * _STEP_S
    kernel = np.exp(-0.5 * (offsets / jitter_s) ** 2)
    kernel /= kernel.sum()
    spread = np.apply_along_axis(np.convolve, -1, single, kernel, "same")
    mean = spread.mean(axis=(1, 2), keepdims=True)
    logs: Array = np.log((1.0 - _OUTLIER_STEP) * spread + _OUTLIER_STEP * mean + 1e-300).sum(axis=0)
    return logs


def _moments(values: Array, weights: Array) -> tuple[float, float]:
    mean = float(weights @ values)
    return mean, float(np.sqrt(max(float(weights @ (values - mean) ** 2), 0.0)))
