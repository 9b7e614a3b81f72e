"""Figures of the gaze controller's runs, scenario by scenario, for any law, servo and latency."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from bench import gaze_runs
from bench import gaze_scenarios as scenarios
from bench.encoder_readings import DrawnFeatures
from bench.gaze_runs import SERVOS, Scenario, Setting, tolerance_deg
from bench.gaze_trace import Trace
from bench.results import Row

DEFAULT = Setting()
KEPT_DEG = 1.0
STEADY_FROM_S = 1.6
GIVEN_SUFFIX = {"class": "", "click": ".by_track", "boxes": ".boxes_alone"}
_STEP_S = 1.5


@dataclass(frozen=True)
class Counts:
    """How many trials of each kind a setting gets."""

    static: int
    steps: int
    occlusions: int
    crossings: int
    rig_turns: int
    rests: int


def counts(setting: Setting) -> Counts:
    """Return the trials of a setting: most for the default, fewest for the other laws."""
    if setting == DEFAULT:
        return Counts(static=100, steps=20, occlusions=20, crossings=20, rig_turns=4, rests=4)
    if setting.law == DEFAULT.law:
        return Counts(static=40, steps=10, occlusions=8, crossings=10, rig_turns=2, rests=2)
    return Counts(static=20, steps=5, occlusions=4, crossings=5, rig_turns=2, rests=2)


def servo_suffix(setting: Setting) -> str:
    """Return what a row's name gets where even the default's names its servo."""
    usual = (setting.law, setting.latency_ms) == (DEFAULT.law, DEFAULT.latency_ms)
    return f".{setting.servo}" if usual else setting.suffix


def run_all(chosen: Iterable[Scenario], setting: Setting) -> list[Trace]:
    """Run scenarios under a setting."""
    return [gaze_runs.run(scenario, setting) for scenario in chosen]


def quantile(values: list[float], share: float) -> float:
    """Return the value that `share` of them do not exceed; infinite ones count as such."""
    ordered = sorted(values)
    return ordered[min(int(share * len(ordered)), len(ordered) - 1)] if ordered else math.nan


class StaticFigures:
    """Figures of the trials with static targets."""

    def __init__(self, traces: list[Trace], setting: Setting) -> None:
        tolerance = tolerance_deg(setting.servo)
        latency_s = SERVOS[setting.servo].command_latency_s
        self.ratios: list[float] = []
        self.declared_s: list[float] = []
        self.verged = 0
        self.false = 0
        self.residual_deg: list[float] = []
        for trace in traces:
            there_s = trace.stays_within_from(tolerance)
            self.ratios.append(there_s / (trace.first_result_s + latency_s + trace.travel_s))
            declared_s = trace.declared_from(there_s) if math.isfinite(there_s) else math.inf
            self.declared_s.append(declared_s - there_s if math.isfinite(declared_s) else math.inf)
            self.verged += declared_s <= 3.0
            self.false += bool((trace.verged & (trace.error_deg > 1.0)).any())
            self.residual_deg.append(float(np.median(np.abs(trace.errors_deg[-50:, 1]))))
        self.count = len(traces)

    def rows(self, suffix: str) -> list[Row]:
        """Return the rows with a suffix to their names."""
        return [
            Row(f"gaze.verged{suffix}", self.verged / self.count, "share"),
            Row(f"gaze.falsely_verged{suffix}", float(self.false), "trials"),
            Row(f"gaze.time_ratio_median{suffix}", quantile(self.ratios, 0.5), "times the bound"),
            Row(f"gaze.time_ratio_p90{suffix}", quantile(self.ratios, 0.9), "times the bound"),
            Row(f"gaze.declared_s{suffix}", quantile(self.declared_s, 0.5), "s"),
        ]


def static_rows(setting: Setting) -> list[Row]:
    """Targets at rest: verged or not, how fast, and how well declared; the default's once by pairs, once by class."""
    count = counts(setting).static
    if setting != DEFAULT:
        figures = StaticFigures(run_all(scenarios.static(count, "pairs", seed=12), setting), setting)
        rows = figures.rows(setting.suffix)
    else:
        by_pairs = run_all(scenarios.static(count, "pairs"), setting)
        by_class = run_all(scenarios.static(count, "class", seed=11), setting)
        figures = StaticFigures(by_pairs + by_class, setting)
        rows = figures.rows("")
        rows += StaticFigures(by_pairs, setting).rows(".by_pairs") + StaticFigures(by_class, setting).rows(".by_class")
    return [*rows, Row(f"gaze.residual_deg{servo_suffix(setting)}", quantile(figures.residual_deg, 0.5), "deg")]


def search_rows(setting: Setting) -> list[Row]:
    """Targets out of view at the start, given by the detector."""
    times = [trace.declared_from(0.0) for trace in run_all(scenarios.out_of_view(40), setting)]
    return [
        Row(f"gaze.search_s{setting.suffix}", quantile(times, 0.5), "s"),
        Row(f"gaze.search_p90_s{setting.suffix}", quantile(times, 0.9), "s"),
    ]


def overshoot(trace: Trace, at_s: float) -> float:
    """Return how far version went past the step, as a share of it."""
    after = trace.time_s >= at_s
    errors = trace.errors_deg[after, 0]
    step = errors[0]
    return max(0.0, float((-errors * math.copysign(1.0, step)).max())) / abs(step)


def steady_error_deg(trace: Trace) -> float:
    """Return the median error once the eyes have caught up with a target that set out at 1 s or before."""
    return float(np.median(trace.error_deg[trace.time_s > STEADY_FROM_S]))


def onset_s(trace: Trace, moves_from_s: float) -> float:
    """Return how long after a target began to move the eyes were first back within a degree, and stayed for 0.2 s."""
    late = trace.time_s >= moves_from_s
    times, errors = trace.time_s[late], trace.error_deg[late]
    left = np.flatnonzero(errors > KEPT_DEG)
    if left.size == 0:
        return 0.0
    for i in range(int(left[0]), times.size):
        for_a_while = (times >= times[i]) & (times < times[i] + 0.2)
        if (errors[for_a_while] <= KEPT_DEG).all():
            return float(times[i]) - moves_from_s
    return math.inf


def boxes_alone_rows(setting: Setting) -> list[Row]:
    """A detected class without a tracker, against the detector and the tracker that it asks, as the graph has them."""
    alone, values = (_given_rows(setting, given) for given in ("boxes", "class"))
    return [replace(a, against="with the tracker", against_value=v.value) for v, a in zip(values, alone, strict=True)]


def _given_rows(setting: Setting, given: str) -> list[Row]:
    still = StaticFigures(run_all(scenarios.static(40, given, seed=13), setting), setting)
    ramps, suffix = run_all(scenarios.ramps((20.0,) * 5, given), setting), GIVEN_SUFFIX[given]
    return [
        Row(f"gaze.verged{suffix}", still.verged / still.count, "share"),
        Row(f"gaze.falsely_verged{suffix}", float(still.false), "trials"),
        Row(f"gaze.declared_s{suffix}", quantile(still.declared_s, 0.5), "s"),
        Row(f"gaze.onset_s{suffix}", quantile([onset_s(trace, 1.0) for trace in ramps], 0.5), "s"),
        Row(f"gaze.pursuit_error_deg{suffix}", float(np.mean([steady_error_deg(trace) for trace in ramps])), "deg"),
        *occlusion_rows(setting, given),
        *crossing_rows(setting, given),
    ]


def step_rows(setting: Setting) -> list[Row]:
    """Jumps of a fixated target: sideways (two targets in turn) and in depth."""
    count, tolerance = counts(setting).steps, tolerance_deg(setting.servo)
    aside = run_all(scenarios.steps(count), setting)
    deep = run_all(scenarios.depth_steps(count), setting)
    settled, again = ([t.stays_within_from(tolerance, _STEP_S) - _STEP_S for t in traces] for traces in (aside, deep))
    return [
        Row(f"gaze.overshoot{setting.suffix}", quantile([overshoot(t, _STEP_S) for t in aside], 0.5), "of the step"),
        Row(f"gaze.step_settled_s{setting.suffix}", quantile(settled, 0.5), "s"),
        Row(f"gaze.depth_step_settled_s{setting.suffix}", quantile(again, 0.5), "s"),
    ]


def pursuit_rows(setting: Setting) -> list[Row]:
    """Ramps, sinusoids, and the rig turning under a resting target."""
    suffix = servo_suffix(setting)
    lags, errors = [], []
    for scenario in scenarios.ramps((20.0,)):
        trace = gaze_runs.run(scenario, setting)
        steady = (trace.time_s > STEADY_FROM_S) & (trace.time_s < scenario.duration_s)
        speed = 20.0 * math.copysign(1.0, float(scenario.target(2.0)[1] - scenario.target(1.0)[1]))
        lags.append(float(np.mean(trace.errors_deg[steady, 0])) / speed * 1e3)
        errors.append(float(np.median(trace.error_deg[steady])))
    rows = [
        Row(f"gaze.pursuit_lag_ms{suffix}", float(np.mean(lags)), "ms"),
        Row(f"gaze.pursuit_error_deg{suffix}", float(np.mean(errors)), "deg"),
    ]
    for name, chosen in (
        ("ramp_5_to_30", scenarios.ramps((5.0, 10.0, 30.0))),
        ("sinusoid_0.1_hz", scenarios.sinusoids((0.1,))),
        ("sinusoid_0.5_hz", scenarios.sinusoids((0.5,))),
        ("sinusoid_1_hz", scenarios.sinusoids((1.0,))),
        ("rig_turning", scenarios.rig_turns(counts(setting).rig_turns)),
    ):
        values = [steady_error_deg(trace) for trace in run_all(chosen, setting)]
        rows.append(Row(f"gaze.{name}_error_deg{suffix}", float(np.mean(values)), "deg"))
    return rows


def occlusion_rows(setting: Setting, given: str = "class") -> list[Row]:
    """One second behind something nearer."""
    traces = run_all(scenarios.occlusions(counts(setting).occlusions, given), setting)
    times = [trace.declared_from(3.0) - 3.0 for trace in traces]
    suffix = f"{GIVEN_SUFFIX[given]}{setting.suffix}"
    return [
        Row(f"gaze.recovery_s{suffix}", quantile(times, 0.5), "s"),
        Row(f"gaze.recovery_worst_s{suffix}", max(times), "s"),
    ]


def occlusion_by_track_rows(setting: Setting) -> list[Row]:
    """The same for a target without a detector class."""
    return occlusion_rows(setting, "click")


def crossing_rows(setting: Setting, given: str = "class") -> list[Row]:
    """A target that passes before another at a different depth: which target the eyes fixate afterwards.

    Judged by the median of the second after it has stopped: overshoot there does not count as loss.
    """
    traces = run_all(scenarios.crossings(counts(setting).crossings, given), setting)
    after = [trace.error_deg[trace.time_s > scenarios.CROSSED_S + 2.0] for trace in traces]
    during = [trace.error_deg[np.abs(trace.time_s - scenarios.CROSSED_S) < 0.6] for trace in traces]
    kept = float(np.mean([bool(np.median(errors) < KEPT_DEG) for errors in after]))
    suffix = f"{GIVEN_SUFFIX[given]}{setting.suffix}"
    return [
        Row(f"gaze.crossing_kept{suffix}", kept, "share"),
        Row(f"gaze.crossing_worst_deg{suffix}", quantile([float(e.max()) for e in during], 0.5), "deg"),
    ]


def crossing_by_track_rows(setting: Setting) -> list[Row]:
    """The same for a target without a detector class."""
    return crossing_rows(setting, "click")


def rest_rows(setting: Setting) -> list[Row]:
    """Motion at rest, with backlash: peak to peak of the joint that moves most."""
    swings = []
    for distance in (0.3, 0.8, 0.5, 1.2)[: counts(setting).rests]:
        point = scenarios.place(distance, 0.1, 0.05)
        scenario = Scenario(scenarios.still(point), scenarios.fixating(point), 6.0, "pairs", seed=int(1e3 * point[0]))
        trace = gaze_runs.run(scenario, setting)
        swings.append(float(np.ptp(trace.joints_deg[trace.time_s > 2.0], axis=0).max()))
    return [Row(f"gaze.limit_cycle_deg{setting.suffix}", max(swings), "deg")]


def distance_rows(setting: Setting, encoder: bool = False) -> list[Row]:
    """Distance at rest and its stated 95 % interval."""
    suffix = f"{setting.servo}.with_encoder" if encoder else setting.servo
    rows: list[Row] = []
    inside, widths, errors = [], [], {}
    for distance in (0.3, 0.5, 1.0, 1.5):
        traces = run_all(scenarios.at_distance(50, distance, DrawnFeatures if encoder else None), setting)
        said = np.array([trace.distance_m[-1] for trace in traces]) / distance
        errors[distance] = float(np.median(np.abs(said[:, 0] - 1.0)))
        inside += ((said[:, 1] <= 1.0) & (said[:, 2] >= 1.0)).tolist()
        widths += (said[:, 2] - said[:, 1]).tolist()
        rows.append(Row(f"gaze.distance_error.{suffix}.at_{distance:g}_m", errors[distance], "of the distance"))
    return [
        *rows,
        Row(f"gaze.distance_error.{suffix}", float(np.mean(list(errors.values()))), "of the distance"),
        Row(f"gaze.distance_interval.{suffix}", float(np.mean(inside)), "share inside"),
        Row(f"gaze.distance_interval_width.{suffix}", float(np.median(widths)), "of the distance"),
    ]


def distance_with_encoder_rows(setting: Setting) -> list[Row]:
    """What the visual encoder gains."""
    return distance_rows(setting, encoder=True)


def step_cost_rows() -> list[Row]:
    """What one control step costs; run it while nothing else runs."""
    traces = run_all(scenarios.static(20, "pairs"), DEFAULT)
    return [Row("gaze.step_ms", float(np.median(np.concatenate([trace.step_s for trace in traces]))) * 1e3, "ms")]
