"""The gaze controller on seeded scenarios in the lockstep simulator, its four laws side by side.

Nothing is rendered: what the metric nodes would say is drawn from the simulator's kinematics with noise, latency, skew,
misses and the mounts' errors; every servo differs from its data sheet by a seeded share. Rows as in docs/control.md.
The other laws' figures stand in rows of their own, with the law, servo and latency after the name.
"""

import math
from collections.abc import Callable, Iterable

import numpy as np

from bench import gaze_runs
from bench import gaze_scenarios as scenarios
from bench.encoder_readings import DrawnFeatures
from bench.gaze_runs import SERVOS, Scenario, Setting, Trace, tolerance_deg
from bench.harness import Row

Say = Callable[[str], None]

DEFAULT = Setting()
OTHER_LAWS = ("pd_bangbang", "pid_pursuit", "metric_descent")
UNSIGNED = "metric_descent"
STATIC_COUNT = 200
SIDE_COUNT = 40
LAW_COUNT = 20
KEPT_DEG = 1.0


def run_all(chosen: Iterable[Scenario], setting: Setting) -> list[tuple[Scenario, Trace]]:
    """Run scenarios under a setting."""
    return [(scenario, gaze_runs.run(scenario, setting)) for scenario in chosen]


class StaticFigures:
    """What the trials with targets at rest say."""

    def __init__(self, trials: list[tuple[Scenario, Trace]], setting: Setting) -> None:
        tolerance = tolerance_deg(setting.servo)
        latency_s = SERVOS[setting.servo].command_latency_s
        self.ratios: list[float] = []
        self.declared_s: list[float] = []
        self.verged = 0
        self.false = 0
        self.residual_deg: list[float] = []
        for _, trace in trials:
            there_s = trace.stays_within_from(tolerance)
            self.ratios.append(there_s / (trace.first_result_s + latency_s + trace.travel_s))
            declared_s = trace.declared_from(there_s) if math.isfinite(there_s) else math.inf
            self.declared_s.append(declared_s - there_s if math.isfinite(declared_s) else math.inf)
            self.verged += declared_s <= 3.0
            self.false += bool((trace.verged & (trace.error_deg > 1.0)).any())
            self.residual_deg.append(float(np.median(np.abs(trace.errors_deg[-50:, 1]))))
        self.count = len(trials)

    def rows(self, suffix: str) -> list[Row]:
        """Return the rows with a suffix to their names."""
        return [
            Row(f"gaze.verged{suffix}", self.verged / self.count, "share"),
            Row(f"gaze.falsely_verged{suffix}", float(self.false), "trials"),
            Row(f"gaze.time_ratio_median{suffix}", quantile(self.ratios, 0.5), "times the bound"),
            Row(f"gaze.time_ratio_p90{suffix}", quantile(self.ratios, 0.9), "times the bound"),
            Row(f"gaze.declared_s{suffix}", quantile(self.declared_s, 0.5), "s"),
        ]


def quantile(values: list[float], share: float) -> float:
    """Return the value that `share` of them do not exceed; infinite ones count as such."""
    ordered = sorted(values)
    return ordered[min(int(share * len(ordered)), len(ordered) - 1)] if ordered else math.nan


def static_rows(say: Say) -> list[Row]:
    """Targets at rest: verged or not, how fast, and how well declared."""
    rows: list[Row] = []
    by_pairs = run_all(scenarios.static(STATIC_COUNT // 2, "pairs"), DEFAULT)
    by_boxes = run_all(scenarios.static(STATIC_COUNT // 2, "boxes", seed=11), DEFAULT)
    figures = StaticFigures(by_pairs + by_boxes, DEFAULT)
    say(f"{STATIC_COUNT} targets at rest: {figures.verged} verged")
    rows += figures.rows("")
    rows += StaticFigures(by_pairs, DEFAULT).rows(".by_pairs") + StaticFigures(by_boxes, DEFAULT).rows(".by_boxes")
    rows.append(Row("gaze.residual_deg.sg90", quantile(figures.residual_deg, 0.5), "deg"))
    rows.append(
        Row("gaze.step_ms", float(np.median(np.concatenate([trace.step_s for _, trace in by_pairs]))) * 1e3, "ms")
    )
    for setting in (
        Setting(servo="ideal"),
        Setting(servo="mg995"),
        Setting(latency_ms=30),
        Setting(latency_ms=120),
        Setting(servo="ideal", latency_ms=30),
        Setting(servo="ideal", latency_ms=120),
        *(Setting(law=law) for law in OTHER_LAWS),
        *(Setting(law=law, servo="ideal") for law in OTHER_LAWS),
    ):
        count = SIDE_COUNT if setting.law == DEFAULT.law else LAW_COUNT
        side = StaticFigures(run_all(scenarios.static(count, "pairs", seed=12), setting), setting)
        say(f"{setting.law}, {setting.servo}, {setting.latency_ms} ms: {side.verged} of {count} verged")
        rows += side.rows(setting.suffix)
        name = f"gaze.residual_deg.{setting.servo}"
        if setting == Setting(servo="ideal"):
            rows.append(Row(name, quantile(side.residual_deg, 0.5), "deg"))
        elif setting.latency_ms == DEFAULT.latency_ms:
            rows.append(Row(f"{name}.{setting.law}", quantile(side.residual_deg, 0.5), "deg"))
    return rows


def search_rows(say: Say) -> list[Row]:
    """Targets out of view at the start, given by the detector."""
    times = [trace.declared_from(0.0) for _, trace in run_all(scenarios.out_of_view(40), DEFAULT)]
    say(f"search: median {quantile(times, 0.5):.2f} s, slowest {max(times):.2f} s")
    return [Row("gaze.search_s", quantile(times, 0.5), "s"), Row("gaze.search_p90_s", quantile(times, 0.9), "s")]


def overshoot(trace: Trace, at_s: float) -> float:
    """Return how far version went past the step, as a share of it."""
    after = trace.time_s >= at_s
    errors = trace.errors_deg[after, 0]
    step = errors[0]
    return max(0.0, float((-errors * math.copysign(1.0, step)).max())) / abs(step)


def step_rows(say: Say) -> list[Row]:
    """Jumps of a fixated target: sideways (two targets in turn) and in depth."""
    rows: list[Row] = []
    for setting in (DEFAULT, Setting(servo="ideal"), *(Setting(law=law) for law in OTHER_LAWS)):
        count = 20 if setting.law == DEFAULT.law else 10
        traces = [trace for _, trace in run_all(scenarios.steps(count), setting)]
        shares = [overshoot(trace, 1.5) for trace in traces]
        settled = [trace.stays_within_from(tolerance_deg(setting.servo), 1.5) - 1.5 for trace in traces]
        rows.append(Row(f"gaze.overshoot{setting.suffix}", quantile(shares, 0.5), "of the step"))
        rows.append(Row(f"gaze.step_settled_s{setting.suffix}", quantile(settled, 0.5), "s"))
        deep = [trace for _, trace in run_all(scenarios.depth_steps(count), setting)]
        again = [trace.stays_within_from(tolerance_deg(setting.servo), 1.5) - 1.5 for trace in deep]
        rows.append(Row(f"gaze.depth_step_settled_s{setting.suffix}", quantile(again, 0.5), "s"))
    say("steps done")
    return rows


def pursuit_rows(say: Say) -> list[Row]:
    """Ramps, sinusoids, and the rig turning under a resting target."""
    rows: list[Row] = []
    settings = [Setting(law=law, servo=servo) for law in ("predictive", *OTHER_LAWS[:2]) for servo in ("ideal", "sg90")]
    for setting in settings:
        lags, errors = [], []
        for scenario, trace in run_all(scenarios.ramps((20.0,)), setting):
            steady = (trace.time_s > 1.6) & (trace.time_s < scenario.duration_s)
            speed = 20.0 * math.copysign(1.0, float(scenario.target(2.0)[1] - scenario.target(1.0)[1]))
            lags.append(float(np.mean(trace.errors_deg[steady, 0])) / speed * 1e3)
            errors.append(float(np.median(trace.error_deg[steady])))
        suffix = f".{setting.servo}" if setting.law == "predictive" else f".{setting.servo}.{setting.law}"
        rows.append(Row(f"gaze.pursuit_lag_ms{suffix}", float(np.mean(lags)), "ms"))
        rows.append(Row(f"gaze.pursuit_error_deg{suffix}", float(np.mean(errors)), "deg"))
        for name, chosen in (
            ("ramp_5_to_30", scenarios.ramps((5.0, 10.0, 30.0))),
            ("sinusoid_0.1_hz", scenarios.sinusoids((0.1,))),
            ("sinusoid_0.5_hz", scenarios.sinusoids((0.5,))),
            ("sinusoid_1_hz", scenarios.sinusoids((1.0,))),
            ("rig_turning", scenarios.rig_turns(4)),
        ):
            if setting.servo == "sg90" and setting.law != "predictive":
                continue
            values = [np.median(trace.error_deg[trace.time_s > 1.6]) for _, trace in run_all(chosen, setting)]
            rows.append(Row(f"gaze.{name}_error_deg{suffix}", float(np.mean(values)), "deg"))
    say("pursuit done")
    return rows


def occlusion_rows(say: Say) -> list[Row]:
    """One second behind something nearer."""
    rows: list[Row] = []
    for given in ("boxes", "click"):
        trials = run_all(scenarios.occlusions(20, given), DEFAULT)
        times = [trace.declared_from(3.0) - 3.0 for _, trace in trials]
        lured = sum(
            bool(trace.error_deg[(trace.time_s > 2.2) & (trace.time_s < 3.0)].max() > 2.0) for _, trace in trials
        )
        name = "gaze.recovery_s" if given == "boxes" else "gaze.recovery_s.by_track"
        rows.append(Row(name, quantile(times, 0.5), "s"))
        rows.append(Row(f"{name}.worst", max(times), "s"))
        say(f"occlusion, {given}: median {quantile(times, 0.5):.2f} s, lured away {lured} of {len(trials)}")
    return rows


def crossing_rows(say: Say) -> list[Row]:
    """A target that passes before another at a different depth: whose are the eyes afterwards?"""
    rows: list[Row] = []
    for given, setting in (
        ("boxes", DEFAULT),
        ("click", DEFAULT),
        *(("boxes", Setting(law=law)) for law in OTHER_LAWS[:2]),
    ):
        traces = [trace for _, trace in run_all(scenarios.crossings(20 if setting == DEFAULT else 10, given), setting)]
        after = [trace.error_deg[trace.time_s > scenarios.CROSSED_S + 2.0] for trace in traces]
        during = [trace.error_deg[np.abs(trace.time_s - scenarios.CROSSED_S) < 0.6] for trace in traces]
        kept = float(np.mean([bool(errors.max() < KEPT_DEG) for errors in after]))
        suffix = setting.suffix if given == "boxes" else ".by_track"
        rows.append(Row(f"gaze.crossing_kept{suffix}", kept, "share"))
        rows.append(Row(f"gaze.crossing_worst_deg{suffix}", quantile([float(e.max()) for e in during], 0.5), "deg"))
        say(f"crossing, {given}, {setting.law}: {kept:.2f} kept")
    return rows


def rest_rows(say: Say) -> list[Row]:
    """Motion at rest, with backlash: peak to peak of the joint that moves most."""
    rows: list[Row] = []
    for setting in (DEFAULT, *(Setting(law=law) for law in OTHER_LAWS)):
        swings = []
        for point in (scenarios.place(distance, 0.1, 0.05) for distance in (0.3, 0.5, 0.8, 1.2)):
            scenario = Scenario(
                scenarios.still(point), scenarios.fixating(point), 6.0, "pairs", seed=int(1e3 * point[0])
            )
            trace = gaze_runs.run(scenario, setting)
            swings.append(float(np.ptp(trace.joints_deg[trace.time_s > 2.0], axis=0).max()))
        rows.append(Row(f"gaze.limit_cycle_deg{setting.suffix}", max(swings), "deg"))
    say("limit cycles done")
    return rows


def distance_rows(say: Say) -> list[Row]:
    """Distance at rest, its stated 95 % interval, and what the visual encoder gains."""
    rows: list[Row] = []
    for servo, encoder, count in (("ideal", False, 50), ("sg90", False, 50), ("sg90", True, 50), ("mg995", False, 50)):
        suffix = f"{servo}.with_encoder" if encoder else servo
        inside, widths, errors = [], [], {}
        for distance in (0.3, 0.5, 1.0, 1.5):
            reads = DrawnFeatures if encoder else None
            trials = run_all(scenarios.at_distance(count, distance, reads), Setting(servo=servo))
            said = np.array([trace.distance_m[-1] for _, trace in trials]) / distance
            errors[distance] = float(np.median(np.abs(said[:, 0] - 1.0)))
            inside += ((said[:, 1] <= 1.0) & (said[:, 2] >= 1.0)).tolist()
            widths += (said[:, 2] - said[:, 1]).tolist()
            rows.append(Row(f"gaze.distance_error.{suffix}.at_{distance:g}_m", errors[distance], "of the distance"))
        rows.append(Row(f"gaze.distance_error.{suffix}", float(np.mean(list(errors.values()))), "of the distance"))
        rows.append(Row(f"gaze.distance_interval.{suffix}", float(np.mean(inside)), "share inside"))
        rows.append(Row(f"gaze.distance_interval_width.{suffix}", float(np.median(widths)), "of the distance"))
    say("distances done")
    return rows


def run(say: Say) -> list[Row]:
    """Run every part and return all rows."""
    rows: list[Row] = []
    parts = (
        static_rows,
        search_rows,
        step_rows,
        pursuit_rows,
        occlusion_rows,
        crossing_rows,
        rest_rows,
        distance_rows,
    )
    for part in parts:
        rows += part(say)
    return rows
