"""A recording through the metric, pair by pair, and what differs between two such runs."""

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from vergence.bags.reader import HeadBag, RecordedMetric
from vergence.bags.writer import BagError
from vergence.body import JointAngles
from vergence.pair_metric import Measurement
from vergence.vision import Vision
from vergence_metric.measurement.parameters import PairMeasurementParameters
from vergence_metric.tracking.request import TrackRequest
from vergence_rig.rig import Rig

_NAN = math.nan


@dataclass(frozen=True)
class PairFigures:
    """What is measured in one pair; NaN where a figure could not be computed or was not recorded.

    Attributes:
        stamp_ns: of the left picture.
        windows_px: sides of the windows; the next three have a figure for each.
        left_to_right_px: metric I.
        right_to_left_px: the same back.
        contrast: with chance.
        verged: whether the eyes are verged; None where it was not recorded.
        disparity_px: signed horizontal disparity at the fovea.
        sigma_px: its standard deviation.
        tracked: whether the tracker sees its target in both eyes; None where it was not recorded.
    """

    stamp_ns: int
    windows_px: tuple[int, ...]
    left_to_right_px: tuple[float, ...]
    right_to_left_px: tuple[float, ...]
    contrast: tuple[float, ...]
    verged: bool | None = None
    disparity_px: float = _NAN
    sigma_px: float = _NAN
    tracked: bool | None = None


def replayed(bag: HeadBag, rig: Rig, parameters: PairMeasurementParameters) -> Iterator[PairFigures]:
    """Measure every pair of a recording, in order. Raises ValueError where a camera is described nowhere."""
    vision, measured_ns = Vision(rig, bag.cameras(), parameters), -1
    metric = vision.metric
    for arrival_ns, event in bag.events():
        if isinstance(event, JointAngles):
            metric.add_joints(event)
            continue
        if isinstance(event, TrackRequest):
            metric.request_pixel(event)
            continue
        vision.add_picture(event, arrival_ns)
        vision.observe(arrival_ns)
        pair, found = metric.newest, None
        if pair is not None and pair.left_stamp_ns != measured_ns:
            measured_ns, found = pair.left_stamp_ns, metric.measurement()
        if found is not None:
            yield _figures(measured_ns, found)


def recorded(metric: Mapping[int, RecordedMetric]) -> list[PairFigures]:
    """Return what the head itself had published of its pairs."""
    return [
        PairFigures(one.stamp_ns, one.windows_px, one.left_to_right_px, one.right_to_left_px, one.contrast)
        for one in metric.values()
    ]


def write_figures(path: Path, figures: Sequence[PairFigures]) -> None:
    """Write figures as JSON lines, NaN as null."""
    lines = (json.dumps(_without_nan(asdict(one)), allow_nan=False) for one in figures)
    path.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")


def read_figures(path: Path) -> list[PairFigures]:
    """Return the figures that `write_figures` wrote. Raises BagError."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
        return [_from_json(json.loads(line)) for line in lines]
    except (OSError, ValueError, TypeError, KeyError) as error:
        raise BagError(f"'{path}' must be a file that `vergence replay --out` wrote: {error}") from error


@dataclass(frozen=True)
class Change:
    """One line of a comparison: what, its value before and after, and in how many pairs it is known in both."""

    name: str
    before: float
    after: float
    unit: str
    pairs: int


def changes(before: Sequence[PairFigures], after: Sequence[PairFigures]) -> list[Change]:
    """Return what differs between two runs through the same recording, in the pairs that both have.

    Raises BagError where they have none in common.
    """
    first = {one.stamp_ns: one for one in before}
    pairs = [(first[one.stamp_ns], one) for one in after if one.stamp_ns in first]
    if not pairs:
        raise BagError(f"both runs must have pairs in common: got {len(before)} and {len(after)} with other stamps")
    rows = []
    common = sorted(set(pairs[0][0].windows_px) & set(pairs[0][1].windows_px))
    for size in common:
        for name in ("left_to_right_px", "right_to_left_px", "contrast"):
            values = [(_of_window(one, name, size), _of_window(other, name, size)) for one, other in pairs]
            shown, unit = name.removesuffix("_px").replace("_", " "), "px" if name.endswith("_px") else ""
            rows.append(_mean(f"{size} px, {shown}", values, unit))
    rows.append(_mean("disparity known", [_known(one, other, "disparity_px") for one, other in pairs], "of pairs"))
    rows.append(_mean("|disparity|", [(abs(one.disparity_px), abs(other.disparity_px)) for one, other in pairs], "px"))
    rows.append(_mean("sigma of disparity", [(one.sigma_px, other.sigma_px) for one, other in pairs], "px"))
    for name in ("verged", "tracked"):
        rows.append(_mean(name, [(_share(one, name), _share(other, name)) for one, other in pairs], "of pairs"))
    return [row for row in rows if row.pairs]


def changed_verdicts(before: Sequence[PairFigures], after: Sequence[PairFigures]) -> list[int]:
    """Return the stamps [ns] of the pairs that are verged in one run and not in the other."""
    first = {one.stamp_ns: one.verged for one in before if one.verged is not None}
    return [one.stamp_ns for one in after if one.stamp_ns in first and first[one.stamp_ns] != one.verged]


def _figures(stamp_ns: int, found: Measurement) -> PairFigures:
    edge = found.edge
    return PairFigures(
        stamp_ns,
        tuple(int(size) for size in edge.windows_px),
        tuple(map(float, edge.left_to_right_px)),
        tuple(map(float, edge.right_to_left_px)),
        tuple(map(float, edge.contrast)),
        found.verged,
        found.disparity.horizontal_px if found.disparity.ok else _NAN,
        found.disparity.sigma_px if found.disparity.ok else _NAN,
        math.isfinite(found.track.disparity_px),
    )


def _of_window(one: PairFigures, name: str, size_px: int) -> float:
    values: tuple[float, ...] = getattr(one, name)
    return values[one.windows_px.index(size_px)] if size_px in one.windows_px else _NAN


def _share(one: PairFigures, name: str) -> float:
    value = getattr(one, name)
    return _NAN if value is None else float(value)


def _known(one: PairFigures, other: PairFigures, name: str) -> tuple[float, float]:
    if one.verged is None or other.verged is None:
        return _NAN, _NAN  # only metric I was recorded
    return float(math.isfinite(getattr(one, name))), float(math.isfinite(getattr(other, name)))


def _mean(name: str, values: Sequence[tuple[float, float]], unit: str) -> Change:
    both = np.array([pair for pair in values if math.isfinite(pair[0]) and math.isfinite(pair[1])]).reshape(-1, 2)
    if not len(both):
        return Change(name, _NAN, _NAN, unit, 0)
    first, second = both.mean(axis=0)
    return Change(name, float(first), float(second), unit, len(both))


def _without_nan(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_nan(one) for key, one in value.items()}
    if isinstance(value, (list, tuple)):
        return [_without_nan(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _from_json(values: dict[str, Any]) -> PairFigures:
    for name in ("left_to_right_px", "right_to_left_px", "contrast"):
        values[name] = tuple(_NAN if one is None else float(one) for one in values[name])
    for name in ("disparity_px", "sigma_px"):
        values[name] = _NAN if values[name] is None else float(values[name])
    return PairFigures(**{**values, "windows_px": tuple(int(size) for size in values["windows_px"])})
