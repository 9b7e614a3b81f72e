"""The gaze controller on seeded scenarios in the lockstep simulator: every law on every servo at every latency.

Nothing is rendered: the metric nodes' outputs are drawn from the simulator's kinematics with noise, latency, skew,
misses and the mounts' errors; every servo differs from its data sheet by a seeded share. A row without a setting in its
name is of the law `predictive` on SG90 servos at 60 ms; others carry `.<law>.<servo>.<latency>`.
"""

import os
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor

from bench import gaze_figures as figures
from bench.gaze_figures import DEFAULT
from bench.gaze_runs import SERVOS, Setting
from bench.gaze_table import table
from bench.heads import identify
from bench.results import Row
from vergence_gaze.law_registry import law_names

__all__ = ["run", "table"]

LAWS = law_names()
LATENCIES_MS = (30, 60, 120)
Part = Callable[[Setting], list[Row]]

SETTINGS = [Setting(law, servo, latency_ms) for law in LAWS for servo in SERVOS for latency_ms in LATENCIES_MS]
EVERYWHERE: tuple[Part, ...] = (
    figures.static_rows,
    figures.step_rows,
    figures.pursuit_rows,
    figures.occlusion_rows,
    figures.crossing_rows,
    figures.rest_rows,
)
BY_DEFAULT: tuple[Part, ...] = (
    figures.search_rows,
    figures.boxes_alone_rows,
    figures.occlusion_by_track_rows,
    figures.crossing_by_track_rows,
)


def jobs() -> list[tuple[Part, Setting]]:
    """Return what is measured, the default's figures first."""
    others = [setting for setting in SETTINGS if setting != DEFAULT]
    return [
        *((part, DEFAULT) for part in (*EVERYWHERE, *BY_DEFAULT)),
        *((figures.distance_rows, Setting(servo=servo)) for servo in SERVOS),
        (figures.distance_with_encoder_rows, DEFAULT),
        *((part, setting) for setting in others for part in EVERYWHERE),
    ]


def run(say: Callable[[str], None]) -> list[Row]:
    """Run every part and return all rows."""
    identify(say)
    rows = figures.step_cost_rows()
    todo = jobs()
    with ProcessPoolExecutor(max_workers=min(len(todo), os.cpu_count() or 1)) as pool:
        for (_, setting), measured, done in zip(todo, pool.map(_measure, todo), range(1, len(todo) + 1), strict=True):
            rows += measured
            if done == len(todo) or todo[done][1] != setting:
                say(f"{done} of {len(todo)}: {setting.law}, {setting.servo}, {setting.latency_ms} ms")
    return rows


def _measure(job: tuple[Part, Setting]) -> list[Row]:
    part, setting = job
    return part(setting)
