"""Cepstral disparity on its own: its accuracy over the whole range, and whether it says where it fails."""

import time
from collections.abc import Callable

import numpy as np

from bench.disparity_pairs import clean, deceptive, hard
from bench.results import Row
from vergence_metric.disparity import make_estimator
from vergence_metric.disparity.parameters import DisparityParameters

_PAIRS, _DECEPTIVE = 40, 120
_REACH_PX = 120.0
_WRONG_PX = 2.0


def cepstrum_rows(say: Callable[[str], None]) -> list[Row]:
    """Return the rows; the default estimator's stand beside them."""
    names = ("cepstral", DisparityParameters().estimator)
    cepstral, default = (make_estimator(DisparityParameters(estimator=name)) for name in names)
    rows = []
    for name, pairs in (("clean", clean(_PAIRS, 21, _REACH_PX)), ("hard", hard(_PAIRS, 22, _REACH_PX))):
        say(f"cepstrum: {name} pairs")
        off: list[list[float]] = [[], []]
        answered, spent_s = 0, 0.0
        for pair in pairs:
            assert pair.disparity_px is not None
            started = time.thread_time()
            answer = cepstral.estimate(pair.left, pair.right)
            spent_s += time.thread_time() - started
            other = default.estimate(pair.left, pair.right)
            answered += answer.ok
            for errors, one in zip(off, (answer, other), strict=True):
                if one.ok:
                    errors.append(one.horizontal_px - pair.disparity_px)
        ours, theirs = (float(np.sqrt(np.mean(np.square(errors)))) for errors in off)
        rows.append(Row(f"tracker.cepstrum.{name}.rms_px", ours, "px RMS of answers", names[1], theirs))
        rows.append(Row(f"tracker.cepstrum.{name}.answered", answered / _PAIRS, "of pairs"))
    rows.append(Row("tracker.cepstrum.cost_ms", 1e3 * spent_s / _PAIRS, "ms of CPU"))
    say(f"cepstrum: {_DECEPTIVE} pairs without an answer")
    false = [0, 0]
    for _, pair in deceptive(_DECEPTIVE, 23):
        for number, estimator in enumerate((cepstral, default)):
            one = estimator.estimate(pair.left, pair.right)
            wrong = pair.disparity_px is None or not abs(one.horizontal_px - pair.disparity_px) <= _WRONG_PX
            false[number] += int(one.ok and wrong)
    rows.append(Row("tracker.cepstrum.false_answers", false[0], f"of {_DECEPTIVE}", names[1], false[1]))
    return rows
