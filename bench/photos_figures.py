"""Rows of the clicks on photographs, and why some were never declared verged."""

import math
import re
from collections import Counter
from collections.abc import Iterable, Sequence

import numpy as np

from bench.photos_data import LIT_DIFFERENTLY, pair_names, targets
from bench.photos_trials import SETTINGS, Outcome, Trial
from bench.results import Row

MISMATCHES = [name for name in SETTINGS if name.startswith("mismatch.")]
_NEAR_DEG = 5.0
_CLICKS_OF_A_PLANT = 2
_NUMBER = re.compile(r"-?\d+(?:\.\d+)?")


def trials(clicks: int) -> list[Trial]:
    """Return every click: `clicks` a pair with SG90 servos, two with every other plant; all of the lighting's.

    Those of one pair stand together.
    """
    found: list[Trial] = []
    for number, name in enumerate(pair_names()):
        main = targets(name, 24 if name == LIT_DIFFERENTLY else clicks)
        fewer = targets(name, min(clicks, _CLICKS_OF_A_PLANT))
        chosen = [(target, "sg90") for target in main]
        chosen += [(target, setting) for setting in ("ideal", *MISMATCHES) for target in fewer]
        found += [
            Trial(target, setting, seed=1000 * number + i + 100 * list(SETTINGS).index(setting))
            for i, (target, setting) in enumerate(chosen)
        ]
    return found


def rows(outcomes: Sequence[Outcome], clicks: int) -> list[Row]:
    """Return the rows; the pair that is lit differently counts in `photo.on_target` no more than the others."""
    every = [o for o in outcomes if o.setting == "sg90"]
    lit = [o for o in every if o.target.pair == LIT_DIFFERENTLY]
    listed = {target.point for target in targets(LIT_DIFFERENTLY, clicks)}
    main = [o for o in every if o.target.pair != LIT_DIFFERENTLY or o.target.point in listed]
    ideal = [o for o in outcomes if o.setting == "ideal"]
    declared = [o for o in main if o.declared]
    return [
        Row("photo.on_target", _share(o.on_target for o in main), f"of {len(main)} clicks"),
        Row("photo.falsely_verged", _share(o.falsely_verged for o in main), f"of {len(main)} clicks"),
        Row("photo.never_declared", _share(not o.declared for o in main), f"of {len(main)} clicks"),
        Row("photo.aside_deg", _median(o.aside_deg for o in declared), "deg, of those declared"),
        Row("photo.aside_deg.ideal", _median(o.aside_deg for o in ideal if o.declared), "deg, of those declared"),
        Row("photo.aside_p90_deg", _quantile((o.aside_deg for o in declared), 0.9), "deg, of those declared"),
        Row("photo.vergence_deg", _median(o.vergence_deg for o in declared), "deg, of those declared"),
        Row("photo.vergence_p90_deg", _quantile((o.vergence_deg for o in declared), 0.9), "deg, of those declared"),
        Row("photo.time_ratio_median", _median(o.time_ratio for o in main), "times the bound"),
        Row("photo.declared_s", _median(o.declared_s for o in declared), "s, of those declared"),
        Row("photo.on_target.ideal", _share(o.on_target for o in ideal), f"of {len(ideal)} clicks"),
        *(_mismatch(name, outcomes) for name in MISMATCHES),
        Row("photo.lighting", _share(o.on_target for o in lit), f"of {len(lit)} clicks"),
        Row("photo.on_target.near", _share(o.on_target for o in main if o.near_deg > _NEAR_DEG), "vergence over 5 deg"),
        Row("photo.outside_share", _median(o.outside_share for o in main), "of a view, median"),
    ]


def reasons(outcomes: Iterable[Outcome]) -> list[str]:
    """Return lines: the last reasons of the clicks that were never declared, the commonest first, numbers as N."""
    silent = [o for o in outcomes if o.setting == "sg90" and not o.declared]
    counted = Counter(f"{o.last_phase}: {_general(o.last_reason)}" for o in silent)
    lines = [f"{count:4d}  {reason}" for reason, count in counted.most_common()]
    return [f"last reasons of the {len(silent)} clicks with SG90 servos that were never declared verged:", *lines]


def by_pair(outcomes: Iterable[Outcome]) -> list[str]:
    """Return lines: every pair's clicks, how many were on target, falsely verged, never declared."""
    listed: dict[str, list[Outcome]] = {}
    for outcome in outcomes:
        if outcome.setting == "sg90":
            listed.setdefault(outcome.target.pair, []).append(outcome)
    lines = [f"{'pair':<18}{'clicks':>7}{'on target':>11}{'false':>7}{'never':>7}"]
    for name, found in listed.items():
        on, false = sum(o.on_target for o in found), sum(o.falsely_verged for o in found)
        lines.append(f"{name:<18}{len(found):>7}{on:>11}{false:>7}{sum(not o.declared for o in found):>7}")
    return lines


def _mismatch(name: str, outcomes: Sequence[Outcome]) -> Row:
    found = [o for o in outcomes if o.setting == name]
    return Row(f"photo.{name}", _share(o.on_target for o in found), f"of {len(found)} clicks")


def _general(reason: str) -> str:
    # What the phase adds before the judge's reason is a number of its own.
    return _NUMBER.sub("N", reason.split("; ", 1)[-1])


def _share(values: Iterable[bool]) -> float:
    listed = list(values)
    return float(np.mean(listed)) if listed else math.nan


def _median(values: Iterable[float]) -> float:
    return _quantile(values, 0.5)


def _quantile(values: Iterable[float], share: float) -> float:
    ordered = sorted(values)
    return ordered[min(int(share * len(ordered)), len(ordered) - 1)] if ordered else math.nan
