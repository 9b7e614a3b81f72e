"""Clicks on real photographs and in rendered rooms, in closed loop: the shipped metric and controller in lockstep.

Before exact views of stereo pairs, and on a marker pen and thin things in the simulated room. A trial is on target if
it was declared verged within 3 s and then rested at most 0.35 degrees aside of the point that was clicked (version,
tilt) and 0.25 degrees off in vergence; falsely verged if it was declared at any time while more than 1 degree aside or
0.5 degrees off in vergence. VERGENCE_PHOTO_CLICKS sets the clicks on each pair (24 at most).
"""

import multiprocessing
import os
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import TypeVar

import cv2

from bench import photos_contrast, photos_disparity, photos_figures, photos_scenes
from bench.heads import identify
from bench.photos_data import NoPhotographsError, pair_names
from bench.photos_trials import run as run_trial
from bench.results import Row, table

__all__ = ["run", "table"]

CLICKS = 12
_PROCESSES = 2
_TRIALS_OF_A_JOB = 4

Trial = TypeVar("Trial")
Outcome = TypeVar("Outcome")


def run(say: Callable[[str], None], clicks: int | None = None) -> list[Row]:
    """Run all clicks and the disparity's points; without photographs only the room's and the motorcycle's."""
    # Before numpy is loaded anew in every process: its own threads would only contend.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    clicks = clicks or int(os.environ.get("VERGENCE_PHOTO_CLICKS", CLICKS))
    try:
        pair_names()
    except NoPhotographsError as error:
        say(f"clicks on photographs skipped: {error}")
        return _scene_rows(say) + _disparity_rows(say, from_photographs=False)
    trials = photos_figures.trials(clicks)
    outcomes = outcomes_of(run_trial, trials, _TRIALS_OF_A_JOB, "clicks on photographs", say)
    for line in (*photos_figures.by_pair(outcomes), "", *photos_figures.reasons(outcomes)):
        say(line)
    rows = photos_figures.rows(outcomes, clicks) + _scene_rows(say) + photos_contrast.rows()
    return rows + _disparity_rows(say, from_photographs=True)


def _scene_rows(say: Callable[[str], None]) -> list[Row]:
    identify(say)
    of_a_room = sum(photos_scenes.CLICKS_OF_A_ROOM.values())
    outcomes = outcomes_of(photos_scenes.run, photos_scenes.trials(), of_a_room, "clicks in rooms", say)
    for line in photos_scenes.failures(outcomes):
        say(line)
    return photos_scenes.rows(outcomes)


def outcomes_of(
    run_one: Callable[[Trial], Outcome], trials: Sequence[Trial], of_a_job: int, what: str, say: Callable[[str], None]
) -> list[Outcome]:
    """Run every trial in one of two processes, `of_a_job` after one another in the same: they share what it keeps."""
    began, said = time.monotonic(), 0
    outcomes: list[Outcome] = []
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(max_workers=_PROCESSES, mp_context=context) as pool:
        for outcome in pool.map(run_one, trials, chunksize=of_a_job):
            outcomes.append(outcome)
            if len(outcomes) >= said + len(trials) // 8 or len(outcomes) == len(trials):
                said = len(outcomes)
                say(f"{said} of {len(trials)} {what}, {time.monotonic() - began:.0f} s")
    return outcomes


def _disparity_rows(say: Callable[[str], None], from_photographs: bool) -> list[Row]:
    say(f"disparity at {photos_disparity.POINTS} points")
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        return photos_disparity.rows(photos_disparity.known_points(photos_disparity.POINTS, from_photographs))
    finally:
        cv2.setNumThreads(threads)
