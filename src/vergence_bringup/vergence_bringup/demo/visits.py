"""Visits the demo's stations; a failure at one becomes its reason, and the demo continues."""

import math
from collections.abc import Callable, Sequence
from typing import Any, Protocol

from vergence_bringup.demo.result import StationResult, unfinished
from vergence_bringup.demo.stations import Station
from vergence_bringup.graph_errors import GraphError, ProcessError


class Runner(Protocol):
    """Visits stations, as `station_runner.StationRunner` does."""

    def wait_until_ready(self) -> None:
        """Wait until every node publishes; raises GraphError or ProcessError."""

    def visit(self, station: Station) -> StationResult:
        """Return the result of a station; raises GraphError or ProcessError."""

    def time_figures(self) -> dict[str, Any]:
        """Return how time passed, for the summary; see `result.duration_text`."""


def visit_all(
    runner: Runner, stations: Sequence[Station], results: list[StationResult], say: Callable[[str], None]
) -> None:
    """Visit one station after the other and append each result.

    A station at which the graph does not answer fails with that reason, and the next one follows. A process that has
    ended, and a graph that does not start, fail every remaining station.
    """
    say("waiting for images, metrics and controller")
    try:
        runner.wait_until_ready()
    except (GraphError, ProcessError) as error:
        say(f"the graph did not start: {error}")
        results += [unfinished(station, f"not visited: {_first_line(error)}") for station in stations]
        return
    for number, station in enumerate(stations, 1):
        say(f"station {number} of {len(stations)}: {station.name}: {station.title}")
        try:
            result = runner.visit(station)
        except GraphError as error:
            result = unfinished(station, str(error))
        except ProcessError as error:
            say(str(error))
            results.append(unfinished(station, _first_line(error)))
            results += [unfinished(left, f"not visited: {_first_line(error)}") for left in stations[number:]]
            return
        results.append(result)
        say(f"   {_verdict(result)}")


def _verdict(result: StationResult) -> str:
    reported = "verged" if result.reported_verged else f"NOT verged ({result.reason})"
    took = f" after {result.time_s:.2f} s" if math.isfinite(result.time_s) else ""
    error = f"{result.true_error_deg:.2f}" if math.isfinite(result.true_error_deg) else "unknown"
    return f"reported {reported}{took}; ground truth {result.truth_text}: vergence error {error} degrees"


def _first_line(error: Exception) -> str:
    return str(error).splitlines()[0]
