"""The demo's measurements at each station, their verdict, table and summary."""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from vergence_bringup.demo.photographs import PhotoFigures
from vergence_bringup.demo.stations import Station
from vergence_bringup.figures.boxes import BoxFigures, corner_text, signed

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class MetricTable:
    """Metric I of one pair; every array has one element per window, NaN where a window holds no edges."""

    windows_px: Sequence[int]
    left_to_right_px: Sequence[float]
    right_to_left_px: Sequence[float]
    contrast: Sequence[float]


def _empty() -> Floats:
    return np.zeros(0)


@dataclass(frozen=True)
class Series:
    """Recorded series; times count from the goal."""

    time_s: Floats = field(default_factory=_empty)
    metric_px: Floats = field(default_factory=_empty)  # mean of both directions in the 100 px window, or the smallest
    contrast: Floats = field(default_factory=_empty)
    state_time_s: Floats = field(default_factory=_empty)
    vergence_deg: Floats = field(default_factory=_empty)  # the controller's estimate
    truth_time_s: Floats = field(default_factory=_empty)
    true_vergence_deg: Floats = field(default_factory=_empty)
    wanted_vergence_deg: Floats = field(default_factory=_empty)  # the vergence angle that fixates the target point
    true_disparity_px: Floats = field(default_factory=_empty)  # mean over what both eyes see of the target
    box_time_s: Floats = field(default_factory=_empty)
    box_center_px: Floats = field(default_factory=_empty)
    box_refined_px: Floats = field(default_factory=_empty)


@dataclass(frozen=True)
class StationResult:
    """The outcome at one station.

    Attributes:
        reported_verged: the controller reported vergence and kept reporting it.
        time_s: from the goal to the first report of vergence.
        true_error_deg: median magnitude of the true vergence error during the hold.
        off_axis_deg: angle between the target point and the optical axis of the worse eye, median.
        tolerance_deg, off_axis_tolerance_deg: the largest of these that count as vergence.
        photo: where the eyes came to rest on photographs; None in a room.
        answer, answer_s: the result of the goal by its name in LookAt.action, and the time to it.
    """

    name: str
    title: str
    moving: bool
    reported_verged: bool
    reason: str
    time_s: float
    true_error_deg: float
    off_axis_deg: float
    tolerance_deg: float
    off_axis_tolerance_deg: float
    start: MetricTable
    end: MetricTable
    fixation_m: tuple[float, float, float]
    target_m: tuple[float, float, float]
    series: Series
    start_box: BoxFigures | None = None
    end_box: BoxFigures | None = None
    photo: PhotoFigures | None = None
    answer: str = ""
    answer_s: float = math.nan

    @property
    def depth_known(self) -> bool:
        """False for a point of photographs whose disparity is not known: the truth is the left eye's alone."""
        return self.photo is None or self.photo.point.depth_known

    @property
    def truth_agrees(self) -> bool:
        """True if by the ground truth both eyes are on the target; the left one, where no more is known."""
        # NaN compares false: an unknown truth never agrees.
        verged = self.true_error_deg <= self.tolerance_deg or not self.depth_known
        return verged and self.off_axis_deg <= self.off_axis_tolerance_deg

    @property
    def truth_text(self) -> str:
        """What the ground truth says, in two words at most."""
        if not self.truth_agrees:
            return "DISAGREES"
        return "agrees" if self.depth_known else "left agrees"

    @property
    def passed(self) -> bool:
        """True if vergence was reported and the ground truth agrees."""
        return self.reported_verged and self.truth_agrees


_NO_TABLE = MetricTable((), (), (), ())
_NOWHERE = (math.nan, math.nan, math.nan)


def unfinished(station: Station, reason: str) -> StationResult:
    """Return the result of a station that was not completed."""
    return StationResult(
        name=station.name,
        title=station.title,
        moving=station.moving,
        reported_verged=False,
        reason=reason,
        time_s=math.nan,
        true_error_deg=math.nan,
        off_axis_deg=math.nan,
        tolerance_deg=math.nan,
        off_axis_tolerance_deg=math.nan,
        start=_NO_TABLE,
        end=_NO_TABLE,
        fixation_m=_NOWHERE,
        target_m=_NOWHERE,
        series=Series(),
    )


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _numbers(values: Sequence[float]) -> list[float | None]:
    return [_number(value) for value in values]


def summary(results: Sequence[StationResult], settings: dict[str, Any]) -> dict[str, Any]:
    """Return the content of summary.json; unknown figures are null."""
    return {
        "passed": all_passed(results),
        **settings,
        "stations": [
            {
                "name": result.name,
                "title": result.title,
                "verged": result.reported_verged,
                "truth_agrees": result.truth_agrees,
                "reason": result.reason,
                "result": result.answer,
                "result_s": _number(result.answer_s),
                "time_s": _number(result.time_s),
                "true_error_deg": _number(result.true_error_deg),
                "tolerance_deg": _number(result.tolerance_deg),
                "off_axis_deg": _number(result.off_axis_deg),
                "windows_px": list(result.start.windows_px),
                "left_to_right_px": {
                    "start": _numbers(result.start.left_to_right_px),
                    "end": _numbers(result.end.left_to_right_px),
                },
                "right_to_left_px": {
                    "start": _numbers(result.start.right_to_left_px),
                    "end": _numbers(result.end.right_to_left_px),
                },
                "contrast": {"start": _numbers(result.start.contrast), "end": _numbers(result.end.contrast)},
                "box": {
                    "start": result.start_box and result.start_box.as_json(),
                    "end": result.end_box and result.end_box.as_json(),
                },
                "fixation_point_m": _numbers(result.fixation_m),
                "target_point_m": _numbers(result.target_m),
                "photo": result.photo and _photo(result.photo),
            }
            for result in results
        ],
    }


def _photo(figures: PhotoFigures) -> dict[str, Any]:
    return {
        "clicked_px": [figures.point.x_px, figures.point.y_px],
        "disparity_px": _number(figures.point.disparity_px),
        "disparity_from": figures.source,
        "rests_px": {eye: _numbers(pixel) for eye, pixel in zip(("left", "right"), figures.rests_px, strict=True)},
        "verged_disparity_px": _number(figures.verged_disparity_px),
    }


def write_summary(path: Path, results: Sequence[StationResult], settings: dict[str, Any]) -> None:
    """Write summary.json."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(summary(results, settings), indent=1, allow_nan=False) + "\n", encoding="utf-8")


def all_passed(results: Sequence[StationResult]) -> bool:
    """Return whether every station passed, and there was one."""
    return bool(results) and all(result.passed for result in results)


def verdict_line(results: Sequence[StationResult]) -> str:
    """Return how many stations verged, and by what that is confirmed."""
    passed = sum(result.passed for result in results)
    known = "" if all(result.photo is None for result in results) else ", as far as it is known"
    return (
        f"{passed} of {len(results)} stations verged, as reported by the graph and confirmed by the ground truth{known}"
    )


def duration_text(settings: dict[str, Any]) -> str:
    """Return how long a demo took, from the settings of its summary."""
    took = f"{settings['duration_s']:g} s in all"
    factor = settings.get("real_time_factor")
    if factor is None:
        return f"{took}, in real time"
    return f"{took}; {settings['simulated_s']:g} s of simulated time passed at {factor:g} of real time"


def _figure(value: float, digits: int) -> str:
    return f"{value:.{digits}f}" if math.isfinite(value) else "-"


def table(results: Sequence[StationResult]) -> str:
    """Return the terminal's table: verdicts, metric I at start and end for every window, and metric II."""
    lines = [
        f"{'station':16} {'reported':10} {'truth':11} {'time':>6} {'true error':>11} {'off axis':>9}   metric in px"
    ]
    for result in results:
        reported = "verged" if result.reported_verged else "NOT VERGED"
        lines.append(
            f"{result.name:16} {reported:10} {result.truth_text:11} {_figure(result.time_s, 2):>5}s"
            f" {_figure(result.true_error_deg, 2):>7} deg {_figure(result.off_axis_deg, 2):>5} deg"
            f"   window {' '.join(f'{size:>6}' for size in result.start.windows_px)}"
        )
        for label, metric in (("start", result.start), ("end", result.end)):
            for arrow, values in (("L to R", metric.left_to_right_px), ("R to L", metric.right_to_left_px)):
                figures = " ".join(f"{_figure(value, 2):>6}" for value in values)
                lines.append(f"{'':73}{label:>5} {arrow} {figures}".rstrip())
        for label, box in (("start", result.start_box), ("end", result.end_box)):
            if box is not None:
                lines.append(f"{'':17}boxes {label:>5} {_box_text(box)}")
        if result.reason:
            lines.append(f"{'':16} {result.reason}")
    return "\n".join(lines)


def _box_text(box: BoxFigures) -> str:
    scores = "/".join(_figure(score, 2) for score in box.scores)
    if not any(math.isfinite(value) for value in box.left_minus_right_px):
        return f"{box.seen} {scores}"
    return (
        f"{box.seen} {scores}  L-R {corner_text(box.left_minus_right_px)}"
        f"  R-L {corner_text(box.right_minus_left_px)}  centre {signed(box.center_px[0])}"
        f"  surface {signed(box.refined_px[0])}"
    )
