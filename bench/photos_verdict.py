"""What a trace of a click shows: declared in time, on the point that was clicked, ever declared beside it."""

import math
from dataclasses import dataclass

import numpy as np

from bench.gaze_runs import travel_s
from bench.photos_lockstep import Trace
from vergence_rig.rig import Rig

DURATION_S = 3.0
REST_S = 0.5
_ASIDE_DEG, _VERGENCE_DEG = 0.35, 0.25
_FALSE_ASIDE_DEG, _FALSE_VERGENCE_DEG = 1.0, 0.5


@dataclass(frozen=True)
class Verdict:
    """What came of a click: times in seconds, errors in degrees at the end; `declared_s` is inf if never."""

    declared_s: float
    falsely_verged: bool
    aside_deg: float
    vergence_deg: float
    time_ratio: float
    last_reason: str
    last_phase: str

    @property
    def declared(self) -> bool:
        """True if the eyes were ever declared verged."""
        return math.isfinite(self.declared_s)

    @property
    def on_target(self) -> bool:
        """True if they were, and rested on the point that was clicked."""
        return self.declared and self.aside_deg <= _ASIDE_DEG and self.vergence_deg <= _VERGENCE_DEG


def verdict_of(trace: Trace, rig: Rig) -> Verdict:
    """Return what a trace shows; `rig` is the one that metric and controller were given."""
    verged, times = np.array(trace.verged), np.array(trace.time_s)
    aside, vergence = np.abs(trace.aside_deg), np.abs(trace.vergence_deg)
    declared = np.flatnonzero(verged)
    false = verged & ((aside > _FALSE_ASIDE_DEG) | (vergence > _FALSE_VERGENCE_DEG))
    return Verdict(
        declared_s=float(times[declared[0]]) if declared.size else math.inf,
        falsely_verged=bool(false.any()),
        aside_deg=float(aside[-1]),
        vergence_deg=float(vergence[-1]),
        time_ratio=_arrived_s(trace, rig) / _bound_s(trace, rig),
        last_reason=trace.reason[-1],
        last_phase=trace.phase[-1],
    )


def _arrived_s(trace: Trace, rig: Rig) -> float:
    """Return from when on all errors stay within the pan servos' dead band (0.25 degrees if they have none) [s]."""
    tolerance = math.degrees(rig.pan_left.servo.dead_band_rad) or 0.25
    outside = np.flatnonzero(trace.largest_deg > tolerance)
    if outside.size == 0:
        return trace.time_s[0]
    return math.inf if outside[-1] + 1 >= len(trace.time_s) else trace.time_s[outside[-1] + 1]


def _bound_s(trace: Trace, rig: Rig) -> float:
    """Return the soonest possible [s]: first result of a pair after the click, the servos' latency and travel."""
    vergence, version, tilt = trace.start_errors_rad
    latency_s = max(joint.servo.command_latency_s for _, joint in rig.joints.items())
    return trace.first_result_s + latency_s + travel_s(np.array([version, vergence, tilt]), rig)
