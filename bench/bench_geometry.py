"""Heads that are not as drawn: lenses off the axes, mounts turned, zeros and scales off, principal points anywhere.

Ten printed heads, each in a room of its own, in the lockstep simulator: clicks on a cube or a pen at 0.3 to 1.5 m. Each
servo's dead band and backlash are up to a fifth off what it is described with. The arms are what metric and controller
are given:

- `identified`: what `vergence identify` finds of the head, before which its cameras have no calibration; with
  VERGENCE_GEOMETRY_DESCRIBED=1 the head's own description instead, and nothing is identified;
- `uncalibrated`: the default rig.yaml, its pans' zeros unknown to 0.05 rad, and cameras without a calibration;
- `principal_point`: the description of heads whose principal points are up to 60 px off.

`.ideal` rows are of ideal servos. VERGENCE_GEOMETRY_CLICKS sets the clicks of `identified` (100); the other arms have
0.4 of them; with fewer than ten there are as many heads.
"""

import os
from collections.abc import Callable, Sequence

import numpy as np

from bench import geometry_identify
from bench.bench_photos import outcomes_of
from bench.geometry_heads import found_rig, identify_head
from bench.geometry_points import PointTrial, angles_deg
from bench.geometry_trials import (
    FOUND,
    HEADS,
    IDENTIFIED,
    PRINCIPAL_POINT,
    UNCALIBRATED,
    GeometryOutcome,
    GeometryTrial,
    trials,
)
from bench.geometry_trials import (
    run as run_trial,
)
from bench.results import Row, table

__all__ = ["run", "table"]

CLICKS = 100
_FEWER = 0.4
Say = Callable[[str], None]


def run(say: Say, clicks: int | None = None) -> list[Row]:
    """Run every arm and return the rows."""
    # Before numpy is loaded anew in every process: its own threads would only contend.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    clicks = clicks or int(os.environ.get("VERGENCE_GEOMETRY_CLICKS", CLICKS))
    described = bool(os.environ.get("VERGENCE_GEOMETRY_DESCRIBED"))
    arm, rows = IDENTIFIED if described else FOUND, []
    heads = range(min(HEADS, clicks))
    if not described:
        found = outcomes_of(identify_head, heads, 1, "heads identified", say)
        rows = geometry_identify.rows(found, say)
    fewer = max(round(_FEWER * clicks), 1)
    sg90 = _clicked(trials(arm, clicks), "clicks, identified", say)
    ideal = _clicked(trials(arm, fewer, ideal_servos=True), "clicks, identified, ideal servos", say)
    uncalibrated = _clicked(trials(UNCALIBRATED, fewer), "clicks, uncalibrated", say)
    principal = _clicked(trials(PRINCIPAL_POINT, fewer), "clicks, principal points off", say)
    for line in failures([*sg90, *ideal, *uncalibrated, *principal]):
        say(line)
    points = [angle for seed in heads for angle in angles_deg(PointTrial(seed, None if described else found_rig(seed)))]
    false = float(np.mean([o.falsely_verged for o in (*sg90, *ideal, *uncalibrated, *principal)]))
    return [
        *rows,
        *identified_rows(sg90, ""),
        *identified_rows(ideal, ".ideal"),
        Row("geometry.point_deg.identified", float(np.median(points)), f"deg, {len(points)} goals"),
        _share("geometry.verged.uncalibrated", uncalibrated, [o.on_target for o in uncalibrated]),
        _share("geometry.principal_point", principal, [o.on_target for o in principal]),
        Row("geometry.falsely_verged", false, "share of all clicks"),
        _share("geometry.falsely_verged.uncalibrated", uncalibrated, [o.falsely_verged for o in uncalibrated]),
    ]


def identified_rows(outcomes: Sequence[GeometryOutcome], suffix: str) -> list[Row]:
    """Return the rows of clicks by heads whose description the graph has; angles and distances of those verged."""
    verged = [o for o in outcomes if o.verged]
    stated = np.array([o.stated_m for o in verged]).reshape(-1, 3)
    true = np.array([o.distance_m for o in verged])
    off = np.abs(stated[:, 0] / true - 1.0)
    inside = (stated[:, 1] <= true) & (true <= stated[:, 2])
    return [
        Row(
            f"geometry.aside_deg.identified{suffix}",
            _median([o.aside_deg for o in verged]),
            "deg",
            "least that one tilt allows",
            _median([o.least_deg for o in verged]),
        ),
        Row(f"geometry.distance_error.identified{suffix}", _median(off.tolist()), "of the distance"),
        Row(f"geometry.distance_interval.identified{suffix}", _mean(inside.tolist()), "share inside"),
        _share(f"geometry.verged.identified{suffix}", outcomes, [o.on_target for o in outcomes]),
    ]


def failures(outcomes: Sequence[GeometryOutcome]) -> list[str]:
    """Return a line for every click that did not end verged on the target, or was falsely verged, with its reason."""
    lines = ["clicks that did not end verged on the target, or were falsely verged at some time:"]
    for o in outcomes:
        if o.on_target and not o.falsely_verged:
            continue
        said = "verged" if o.verged else "verged before" if o.ever_verged else "never verged"
        lines.append(
            f"  {o.trial.arm}{' ideal' if o.trial.ideal_servos else ''}, head {o.trial.head}, click {o.trial.number}, "
            f"{o.distance_m:.2f} m: {said}{', FALSELY' if o.falsely_verged else ''}, {o.aside_deg:.2f} deg aside, "
            f"appears {o.seen_deg:.2f} deg aside; {o.reason}"
        )
    return lines


def _clicked(chosen: Sequence[GeometryTrial], what: str, say: Say) -> list[GeometryOutcome]:
    return outcomes_of(run_trial, chosen, -(-len(chosen) // HEADS), what, say)


def _share(name: str, outcomes: Sequence[GeometryOutcome], holds: Sequence[bool]) -> Row:
    return Row(name, _mean(holds), f"of {len(outcomes)} clicks")


def _median(values: Sequence[float]) -> float:
    return float(np.median(values)) if values else float("nan")


def _mean(values: Sequence[bool]) -> float:
    return float(np.mean(values)) if values else float("nan")
