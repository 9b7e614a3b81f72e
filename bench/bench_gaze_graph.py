"""The gaze controller through real processes: rendered images, both metrics, the action, true joints.

Simulator, nodes and recorder share this machine, so cameras and detector run at the demo's rates. The peer is the
lockstep bench (`gaze`): the same scenarios, at those rates and the latency measured here.
"""

import dataclasses
import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from bench import gaze_runs
from bench import gaze_scenarios as scenarios
from bench.gaze_figures import STEADY_FROM_S, StaticFigures, onset_s, quantile, steady_error_deg
from bench.gaze_graph_head import SERVO, TARGET, ProcessHead, open_head
from bench.gaze_runs import Realism, Scenario, Setting, Trace
from bench.heads import identify, joints_of
from bench.results import Row
from vergence_bringup.ros.simulated_head import BOX_RATE_HZ, FRAME_RATE_HZ

PEER = "lockstep"
BY_CLASS, BY_CLICKS, SEARCHES, OCCLUSIONS, RAMPS = 12, 12, 6, 4, 6
HIDDEN_S = (2.5, 3.5)
# 20 degrees/s across the line of sight at 0.8 m, from 20 degrees on one side to 20 on the other.
RAMP_M_S = 0.8 * math.radians(20.0)
RAMP_S, MOVES_FROM_S = 2.0, 1.0
BOX_LATENCY_S = 0.04
Array = npt.NDArray[np.float64]


def run(say: Callable[[str], None]) -> list[Row]:
    """Run every scenario on the head of processes, then in lockstep, and return the rows."""
    with_tracker = [
        in_the_open(scenarios.static(40, "class", seed=21))[:BY_CLASS],
        in_the_open(scenarios.static(40, "two_clicks", seed=22))[:BY_CLICKS],
        in_the_open(scenarios.out_of_view(20, "class", seed=23))[:SEARCHES],
        [longer(s) for s in in_the_open(scenarios.occlusions(20, "class", seed=24))[:OCCLUSIONS]],
        [ramp((-1.0) ** i, i) for i in range(RAMPS)],
    ]
    names = ("at rest, by class", "at rest, by two clicks", "out of view", "hidden for a second", "at 20 degrees/s")
    real: list[list[Trace]] = []
    identify(say)
    with open_head() as head:
        visits = (
            head.at_rest,
            head.at_rest,
            head.at_rest,
            lambda s: head.hidden(s, *HIDDEN_S),
            lambda s: pursue(head, s),
        )
        for name, chosen, visit in zip(names, with_tracker, visits, strict=True):
            real.append([visit(scenario) for scenario in chosen])
            say(f"{len(chosen)} targets {name}")
        latency_ms = 1e3 * head.latency_s()
    setting = Setting(servo=SERVO, latency_ms=round(latency_ms))
    box = {"rate_hz": BOX_RATE_HZ, "latency_s": BOX_LATENCY_S, "noise_px": 1.2}
    say(f"the same in lockstep, pairs {latency_ms:.0f} ms old")
    lockstep = [
        [gaze_runs.run(scenario, setting, Realism(frame_rate_hz=FRAME_RATE_HZ, box=box)) for scenario in chosen]
        for chosen in with_tracker
    ]
    values, peers = (figures(traces, setting) for traces in (real, lockstep))
    rows = [dataclasses.replace(v, against=PEER, against_value=p.value) for v, p in zip(values, peers, strict=True)]
    return [*rows, Row("gaze.pair_age_ms.processes", latency_ms, "ms")]


def figures(traces: list[list[Trace]], setting: Setting) -> list[Row]:
    """Return the rows of a set of runs, processes or lockstep."""
    by_class, by_clicks, searches, occlusions, ramps = traces
    still, of_class = StaticFigures(by_class + by_clicks, setting), StaticFigures(by_class, setting)
    recoveries = [trace.declared_from(HIDDEN_S[1]) - HIDDEN_S[1] for trace in occlusions]
    return [
        Row("gaze.verged.processes", still.verged / still.count, "share"),
        Row("gaze.falsely_verged.processes", float(still.false), "trials"),
        # A click is itself the first result: the bound from there is a few cycles, too little for samples of 20 ms.
        Row("gaze.time_ratio_median.processes", quantile(of_class.ratios, 0.5), "times the bound"),
        Row("gaze.time_ratio_p90.processes", quantile(of_class.ratios, 0.9), "times the bound"),
        Row("gaze.declared_s.processes", quantile(still.declared_s, 0.5), "s"),
        Row("gaze.residual_deg.sg90.processes", quantile(still.residual_deg, 0.5), "deg"),
        Row("gaze.search_s.processes", quantile([trace.declared_from(0.0) for trace in searches], 0.5), "s"),
        Row("gaze.recovery_s.processes", quantile(recoveries, 0.5), "s"),
        Row("gaze.onset_s.processes", quantile([onset_s(trace, MOVES_FROM_S) for trace in ramps], 0.5), "s"),
        Row("gaze.pursuit_lag_ms.sg90.processes", float(np.mean([_lag_ms(trace) for trace in ramps])), "ms"),
        Row(
            "gaze.pursuit_error_deg.sg90.processes", float(np.mean([steady_error_deg(trace) for trace in ramps])), "deg"
        ),
    ]


def _lag_ms(trace: Trace) -> float:
    """Return how far behind the target the version was, over the target's angular speed."""
    steady = trace.time_s > STEADY_FROM_S
    wanted = trace.errors_deg[steady, 0] + trace.joints_deg[steady, :2].mean(axis=1)
    speed = np.polyfit(trace.time_s[steady], wanted, 1)[0]
    return float(trace.errors_deg[steady, 0].mean() / speed) * 1e3


def ramp(way: float, seed: int) -> Scenario:
    """Return a target that crosses the view to the left (way 1) or right (-1), straight and at one speed."""

    def target(time_s: float) -> Array:
        gone_s = min(max(time_s - MOVES_FROM_S, 0.0), RAMP_S)
        return np.array([0.8, way * RAMP_M_S * (gone_s - 0.5 * RAMP_S), 0.03])

    # A saccade brings the eyes to the target.
    aside = scenarios.fixating(target(0.0) + np.array([0.0, 0.12, 0.1]))
    return Scenario(target, aside, MOVES_FROM_S + RAMP_S, "class", seed=25_000 + seed)


def pursue(head: ProcessHead, scenario: Scenario) -> Trace:
    """Run a ramp on the head of processes."""
    way = scenario.target(MOVES_FROM_S + 1.0) - scenario.target(MOVES_FROM_S)
    return head.pursuing(scenario, way, MOVES_FROM_S)


def longer(occlusion: Scenario) -> Scenario:
    """Return an occlusion that comes when real processes have verged for a while."""
    return dataclasses.replace(
        occlusion, duration_s=6.0, visible=lambda time_s: not HIDDEN_S[0] <= time_s < HIDDEN_S[1]
    )


def in_the_open(chosen: list[Scenario]) -> list[Scenario]:
    """Return the scenarios whose target neither the room's furniture nor its walls hide from either eye."""
    simulator = gaze_runs.world()
    seen = []
    for scenario in chosen:
        point = scenario.target(0.0)
        simulator.place_target(TARGET, point)
        simulator.set_head(joints_of(simulator.head.real, scenarios.fixating(point)))
        truth = simulator.truth()
        if min(truth.left_visible_share, truth.right_visible_share) > 0.99:
            seen.append(scenario)
    return seen
