"""The whole demo several times over, every second time beside a core that something else keeps busy.

Twenty runs of all stations take about an hour on two cores; VERGENCE_DEMO_RUNS=4 makes it four.
"""

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from bench.results import OUT_DIR, Row

RUNS = 20
_LONGEST_S = 1800.0


def run(say: Callable[[str], None]) -> list[Row]:
    """Run the demos and return the rows: how many passed, the spread of a station's times, and how fast time passed."""
    runs = int(os.environ.get("VERGENCE_DEMO_RUNS", RUNS))
    quiet: list[dict[str, Any]] = []
    loaded: list[dict[str, Any]] = []
    for number in range(1, runs + 1):
        with_load = number % 2 == 0
        summary = _demo(OUT_DIR / "demo" / str(number), with_load)
        (loaded if with_load else quiet).append(summary)
        say(f"run {number} of {runs}{', beside a busy core' if with_load else ''}: {_described(summary)}")
    summaries = quiet + loaded
    rows = [
        Row(f"demo.passed_of_{runs}", float(sum(bool(summary.get("passed")) for summary in summaries)), "runs"),
        Row("demo.time_spread_ms", 1e3 * max(spreads_s(summaries).values(), default=float("nan")), "ms"),
        Row("demo.duration_s", _mean(quiet, "duration_s"), "s"),
        Row("demo.duration_s.loaded", _mean(loaded, "duration_s"), "s"),
        Row("demo.real_time_factor", _mean(quiet, "real_time_factor"), "1"),
        Row("demo.real_time_factor.loaded", _mean(loaded, "real_time_factor"), "1"),
    ]
    for name, spread_s in spreads_s(summaries).items():
        rows.append(Row(f"demo.time_spread_ms.{name}", 1e3 * spread_s, "ms"))
    return rows


def spreads_s(summaries: list[dict[str, Any]]) -> dict[str, float]:
    """Return by station the longest less the shortest time to vergence [s] of all runs that have one."""
    times: dict[str, list[float]] = {}
    for summary in summaries:
        for station in summary.get("stations", ()):
            if station["time_s"] is not None:
                times.setdefault(station["name"], []).append(station["time_s"])
    return {name: max(values) - min(values) for name, values in times.items()}


def _demo(out_dir: Path, with_load: bool) -> dict[str, Any]:
    """Run one demo and return its summary; an empty one where it wrote none."""
    command = [sys.executable, "-m", "vergence_bringup.command_line", "demo", "--out", str(out_dir)]
    path = out_dir / "summary.json"
    path.unlink(missing_ok=True)
    load = subprocess.Popen([sys.executable, "-c", "while True: pass"]) if with_load else None
    began_s = time.monotonic()
    try:
        subprocess.run(command, stdout=subprocess.DEVNULL, timeout=_LONGEST_S, check=False)
    except subprocess.TimeoutExpired:
        return {"duration_s": time.monotonic() - began_s}
    finally:
        if load is not None:
            load.kill()
            load.wait()
    summary: dict[str, Any] = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    return summary


def _described(summary: dict[str, Any]) -> str:
    stations = summary.get("stations", ())
    passed = [station for station in stations if station["verged"] and station["truth_agrees"]]
    failed = [f"{station['name']}: {station['reason']}" for station in stations if station not in passed]
    figures = f"{summary.get('duration_s')} s at {summary.get('real_time_factor')} of real time"
    return "; ".join([f"{len(passed)} of {len(stations)} stations, {figures}", *failed])


def _mean(summaries: list[dict[str, Any]], key: str) -> float:
    values = [summary[key] for summary in summaries if summary.get(key) is not None]
    return sum(values) / len(values) if values else float("nan")
