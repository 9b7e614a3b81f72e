"""`vergence replay`: a recording through the metric with other parameters, and what changed; needs no ROS."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from vergence.bags.reader import HeadBag
from vergence.bags.replay import (
    Change,
    PairFigures,
    changed_verdicts,
    changes,
    read_figures,
    recorded,
    replayed,
    write_figures,
)
from vergence_metric.measurement.parameters import PairMeasurementParameters, pair_measurement_parameters
from vergence_rig.regular_file import expanded
from vergence_rig.rig_file import load_rig
from vergence_rig.yaml_file import parse_yaml

_LISTED = 10


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of the subcommand."""
    parser.add_argument("bag", type=expanded, metavar="BAG", help="folder or .mcap file of a recording")
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        dest="changed",
        metavar="NAME=VALUE",
        help="parameter of edge_metric_node after the change, such as edges.blur_sigma_px=2.0; may be repeated",
    )
    parser.add_argument(
        "--before-set",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="parameter before the change; without any the shipped ones, or what the head had published",
    )
    parser.add_argument(
        "--against",
        type=expanded,
        metavar="FILE",
        help="compare with the figures of a former run (its --out), such as one of another version",
    )
    parser.add_argument("--out", type=expanded, metavar="FILE", help="write the figures of every pair as JSON lines")
    parser.add_argument("--rig", default="", metavar="FILE", help="rig.yaml of the head (default: the built-in one)")
    parser.add_argument("--namespace", metavar="NAME", help="of the head in the recording, if it has several")


def run(options: argparse.Namespace) -> int:
    """Measure the recording and print what changed; 0."""
    if options.against is not None and options.before_set:
        raise ValueError("--against and --before-set must not be given together: both say what to compare with")
    after_parameters, rig = _parameters(options.changed), load_rig(options.rig)
    former = None if options.against is None else read_figures(options.against)
    with HeadBag(options.bag, options.namespace) as bag:
        after = list(replayed(bag, rig, after_parameters))
        if not after:
            raise ValueError(f"the recording '{options.bag}' must have pairs of both eyes: it has none")
        before, name = former, f"{options.against}"
        if before is None and not (options.changed or options.before_set):
            before, name = recorded(bag.metric()), "as the head had published it"
        elif before is None:
            before, name = list(replayed(bag, rig, _parameters(options.before_set))), "by the parameters before"
    if options.out is not None:
        write_figures(options.out, after)
    print(_seen(options.bag, after))
    if not before:
        _print_alone(after)
    else:
        _print_changes(before, after, name)
    return 0


def _parameters(texts: Sequence[str]) -> PairMeasurementParameters:
    values: dict[str, Any] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals or not name:
            raise ValueError(f"a parameter must be given as NAME=VALUE: got '{text}'")
        values[name] = parse_yaml(value)
    return pair_measurement_parameters(values)


def _seen(bag: Path, figures: Sequence[PairFigures]) -> str:
    duration_s = (figures[-1].stamp_ns - figures[0].stamp_ns) * 1e-9
    return f"{bag}: {len(figures)} pairs in {duration_s:.1f} s"


def _print_alone(after: Sequence[PairFigures]) -> None:
    print(f"no vergence/edge was recorded to compare with: give --set or --against\n{'':>22}  {'mean':>8}")
    for row in changes(after, after):
        print(f"{row.name:>22}  {row.after:>8.3f}  {row.unit}")


def _print_changes(before: Sequence[PairFigures], after: Sequence[PairFigures], name: str) -> None:
    print(f"before: {name}\n{'':>22}  {'before':>8}  {'after':>8}  {'change':>8}  {'':8}  {'pairs':>5}")
    for row in changes(before, after):
        print(_line(row))
    verdicts = changed_verdicts(before, after)
    if not verdicts:
        return
    begin_ns = after[0].stamp_ns
    times = ", ".join(f"{(stamp_ns - begin_ns) * 1e-9:.2f}" for stamp_ns in verdicts[:_LISTED])
    more = ", ..." if len(verdicts) > _LISTED else ""
    print(f"verged in one of them only: {len(verdicts)} pairs, at {times}{more} s")


def _line(row: Change) -> str:
    figures = f"{row.before:>8.3f}  {row.after:>8.3f}  {row.after - row.before:>+8.3f}"
    return f"{row.name:>22}  {figures}  {row.unit:8}  {row.pairs:>5}"
