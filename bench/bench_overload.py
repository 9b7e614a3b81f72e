"""Clicks on photographs with half the CPU that the loop needs, in lockstep: 15 Hz, pairs 67 ms later, cycles missed."""

import os
from collections.abc import Callable

import numpy as np

from bench.bench_photos import outcomes_of
from bench.overload_lockstep import OverloadedLockstep
from bench.photos_data import NoPhotographsError, pair_names, targets
from bench.photos_trials import Outcome, Trial
from bench.photos_trials import run as run_trial
from bench.results import Row

CLICKS = 2
_TRIALS_OF_A_JOB = 2
_PEER = "the same clicks with enough CPU"


def run(say: Callable[[str], None]) -> list[Row]:
    """Run the same clicks with half the CPU and with enough; VERGENCE_OVERLOAD_CLICKS sets how many on each pair."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        names = pair_names()
    except NoPhotographsError as error:
        say(f"skipped: {error}")
        return []
    each = int(os.environ.get("VERGENCE_OVERLOAD_CLICKS", CLICKS))
    clicks = [Trial(target, seed=i) for i, target in enumerate(t for name in names for t in targets(name, each))]
    slow = outcomes_of(run_overloaded, clicks, _TRIALS_OF_A_JOB, "clicks with half the CPU", say)
    fast = outcomes_of(run_trial, clicks, _TRIALS_OF_A_JOB, "clicks with enough", say)
    unit = f"of {len(clicks)} clicks"
    return [
        Row("overload.verged", _share(slow, "on_target"), unit, _PEER, _share(fast, "on_target")),
        Row("overload.falsely_verged", _share(slow, "falsely_verged"), unit, _PEER, _share(fast, "falsely_verged")),
    ]


def run_overloaded(trial: Trial) -> Outcome:
    """Run a click with half the CPU that the loop needs."""
    return run_trial(trial, OverloadedLockstep)


def _share(outcomes: list[Outcome], what: str) -> float:
    return float(np.mean([getattr(outcome, what) for outcome in outcomes]))
