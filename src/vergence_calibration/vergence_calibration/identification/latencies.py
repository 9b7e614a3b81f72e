"""From measured lags to the latencies of servos and cameras.

Measured is, for every axis and eye, the time from a command to the motion in the images, by the images' stamps:

    lag(joint, eye) = servo latency(joint) + lateness of the eye's stamps

where a stamp's lateness is its time after the middle of the exposure. The lags alone do not determine both terms: 10 ms
more for every servo and 10 ms less for both cameras give the same measurements. Determined are the sum (the loop's
delay), the arrival after the stamp, and the difference of the two cameras' lateness, since the tilt moves both. The
split needs an assumption, one of

    stamps  the images' stamps are correct (of two that differ, the earlier: stamps are late, never early)
    joints  joint_states are correct: they come from encoders, or from a driver whose latency has been measured
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from vergence_calibration.identification.axis_log import EYES, IdentifyError
from vergence_calibration.identification.step_timing import StepTiming

ASSUMPTIONS = ("stamps", "joints")

_SIGNIFICANT = 3.0
_LEAST_CORRECTION_S = 0.002
_MOST_S = 1.0


@dataclass(frozen=True)
class AxisTiming:
    """One axis's steps as seen in each eye that it turns, and in joint_states (None if they did not show them)."""

    joint: str
    seen: Mapping[str, StepTiming]
    reported: StepTiming | None


@dataclass(frozen=True)
class Arrival:
    """Time from an image's stamp to its arrival, by eye: median and 95th percentile, and the frames' interval [s]."""

    median_s: float
    late_s: float
    interval_s: float


@dataclass(frozen=True)
class Estimate:
    """A time and its standard deviation [s]; NaN where it was not measured."""

    value_s: float
    sigma_s: float

    @property
    def known(self) -> bool:
        """True if it was measured."""
        return math.isfinite(self.value_s)


UNKNOWN = Estimate(math.nan, math.nan)


@dataclass(frozen=True)
class Latencies:
    """The latencies under an assumption.

    servo_s: command to first motion, by joint. stamp_late_s: by how much each eye's stamps lie after the exposure.
    exposure_to_arrival_s: by eye. joints_late_s: by how much joint_states are behind the true motion, by joint
    (negative: ahead). eyes_apart_s: left stamps' lateness minus right's, which needs no assumption; known if the tilt
    moved. loop_s: command to the arrival of a picture of the motion, of the slowest axis; no assumption either.
    """

    assumption: str
    servo_s: Mapping[str, Estimate]
    stamp_late_s: Mapping[str, Estimate]
    exposure_to_arrival_s: Mapping[str, Estimate]
    joints_late_s: Mapping[str, Estimate]
    eyes_apart_s: Estimate
    loop_s: Estimate


def split(timings: Mapping[str, AxisTiming], arrivals: Mapping[str, Arrival], assumption: str) -> Latencies:
    """Return the latencies under an assumption (see the module). Raises IdentifyError where it cannot be applied."""
    if assumption not in ASSUMPTIONS:
        raise IdentifyError(f"assumption must be one of {', '.join(ASSUMPTIONS)}: got {assumption!r}")
    apart = _eyes_apart(timings)
    late = _lateness_by_joints(timings) if assumption == "joints" else _lateness_by_stamps(apart)
    servo, joints_late = {}, {}
    for joint, timing in timings.items():
        seen = [
            _minus(Estimate(t.onset_s, t.onset_sigma_s), late[eye]) for eye, t in timing.seen.items() if late[eye].known
        ]
        servo[joint] = _mean(seen)
        if timing.reported is None:
            joints_late[joint] = UNKNOWN
            continue
        reported = Estimate(timing.reported.middle_s, timing.reported.middle_sigma_s)
        middles = [
            _minus(Estimate(t.middle_s, t.middle_sigma_s), late[eye])
            for eye, t in timing.seen.items()
            if late[eye].known
        ]
        joints_late[joint] = _minus(reported, _mean(middles))
        if assumption == "joints":
            servo[joint] = Estimate(timing.reported.onset_s, timing.reported.onset_sigma_s)
    for joint, latency in servo.items():
        if latency.value_s < -3 * latency.sigma_s - 0.005 or latency.value_s > _MOST_S:
            raise IdentifyError(
                f"{joint} must move 0 to {1e3 * _MOST_S:.0f} ms after its command: got {1e3 * latency.value_s:+.0f} ms "
                f"under the assumption '{assumption}'; use the other assumption, or set the clocks"
            )
    return Latencies(
        assumption=assumption,
        servo_s=servo,
        stamp_late_s=late,
        exposure_to_arrival_s={
            eye: Estimate(arrivals[eye].median_s + late[eye].value_s, late[eye].sigma_s) for eye in EYES
        },
        joints_late_s=joints_late,
        eyes_apart_s=apart,
        loop_s=_loop(timings, arrivals),
    )


def _eyes_apart(timings: Mapping[str, AxisTiming]) -> Estimate:
    if "tilt" not in timings:
        return UNKNOWN
    left, right = (timings["tilt"].seen[eye] for eye in EYES)
    return Estimate(left.middle_s - right.middle_s, math.hypot(left.middle_sigma_s, right.middle_sigma_s))


def _lateness_by_stamps(apart: Estimate) -> dict[str, Estimate]:
    late = dict.fromkeys(EYES, Estimate(0.0, 0.0))
    if apart.known and abs(apart.value_s) > max(_SIGNIFICANT * apart.sigma_s, _LEAST_CORRECTION_S):
        late["left" if apart.value_s > 0 else "right"] = Estimate(abs(apart.value_s), apart.sigma_s)
    return late


def _lateness_by_joints(timings: Mapping[str, AxisTiming]) -> dict[str, Estimate]:
    late = {}
    for eye in EYES:
        seen = [
            _minus(
                Estimate(t.seen[eye].middle_s, t.seen[eye].middle_sigma_s),
                Estimate(t.reported.middle_s, t.reported.middle_sigma_s),
            )
            for t in timings.values()
            if eye in t.seen and t.reported is not None
        ]
        if not seen and any(eye in t.seen for t in timings.values()):
            raise IdentifyError("joint_states do not show the moves: the assumption must be 'stamps'")
        late[eye] = _mean(seen)
    return late


def _loop(timings: Mapping[str, AxisTiming], arrivals: Mapping[str, Arrival]) -> Estimate:
    whole = [
        Estimate(t.onset_s + arrivals[eye].median_s, t.onset_sigma_s)
        for timing in timings.values()
        for eye, t in timing.seen.items()
    ]
    return max(whole, key=lambda estimate: estimate.value_s)


def _minus(one: Estimate, other: Estimate) -> Estimate:
    return Estimate(one.value_s - other.value_s, math.hypot(one.sigma_s, other.sigma_s))


def _mean(estimates: list[Estimate]) -> Estimate:
    """Return the weighted mean; its deviation covers the estimates' disagreement."""
    if not estimates:
        return UNKNOWN
    weights = [1.0 / max(e.sigma_s, 1e-4) ** 2 for e in estimates]
    total = sum(weights)
    value_s = sum(w * e.value_s for w, e in zip(weights, estimates, strict=True)) / total
    spread = sum(w * (e.value_s - value_s) ** 2 for w, e in zip(weights, estimates, strict=True)) / len(estimates)
    return Estimate(value_s, math.sqrt(max(1.0, spread) / total))
