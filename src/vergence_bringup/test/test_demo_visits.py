"""The round of the stations: a graph that does not answer is a reason, never the end of the demo."""

import contextlib
import dataclasses
import json
import signal

import pytest

from vergence_bringup.command_line import main
from vergence_bringup.demo.result import StationResult, unfinished
from vergence_bringup.demo.ros import command as demo
from vergence_bringup.demo.stations import stations
from vergence_bringup.demo.visits import visit_all
from vergence_bringup.graph_errors import GraphError, ProcessError

THREE = stations(0.065, short=True)


class ScriptedRunner:
    """Stands in for the graph: raises what is written for a station's name, or for "ready"."""

    def __init__(self, failures):
        self.failures = failures
        self.visited = []

    def wait_until_ready(self):
        if "ready" in self.failures:
            raise self.failures["ready"]

    def time_figures(self):
        return {"simulated_s": 60.0, "real_time_factor": 0.6}

    def visit(self, station):
        self.visited.append(station.name)
        if station.name in self.failures:
            raise self.failures[station.name]
        return dataclasses.replace(
            unfinished(station, ""),
            reported_verged=True,
            true_error_deg=0.1,
            off_axis_deg=0.1,
            tolerance_deg=0.75,
            off_axis_tolerance_deg=2.6,
        )


def outcome(failures):
    runner = ScriptedRunner(failures)
    results: list[StationResult] = []
    said: list[str] = []
    visit_all(runner, THREE, results, said.append)
    assert [result.name for result in results] == [station.name for station in THREE]
    return runner, results, "\n".join(said)


def test_every_station_is_visited_in_order():
    runner, results, said = outcome({})
    assert runner.visited == [station.name for station in THREE]
    assert all(result.passed for result in results)
    assert said.count("reported verged") == 3


def test_a_node_that_does_not_answer_fails_its_station_and_the_next_is_tried():
    silent = GraphError("timeout after 5 s waiting for sim_node to set parameters")
    runner, results, said = outcome({THREE[1].name: silent})
    assert [result.passed for result in results] == [True, False, True]
    assert results[1].reason == str(silent)
    assert len(runner.visited) == 3
    assert str(silent) in said


def test_a_node_that_died_ends_the_round_and_every_station_says_why():
    dead = ProcessError("sim_node ended with status 1; the end of its log:\n  Traceback")
    runner, results, said = outcome({THREE[1].name: dead})
    assert runner.visited == [station.name for station in THREE[:2]]
    assert [result.passed for result in results] == [True, False, False]
    assert results[1].reason == "sim_node ended with status 1; the end of its log:"
    assert results[2].reason.startswith("not visited: sim_node ended")
    assert "Traceback" in said


@pytest.mark.parametrize("error", [GraphError("no ground truth"), ProcessError("sim_node ended with status 2")])
def test_a_graph_that_never_gets_ready_fails_them_all(error):
    runner, results, _ = outcome({"ready": error})
    assert runner.visited == []
    assert [result.reason for result in results] == [f"not visited: {error}"] * 3


@pytest.fixture
def own_signals():
    """Give the signal handlers back that the command sets."""
    before = signal.getsignal(signal.SIGTERM)
    yield
    signal.signal(signal.SIGTERM, before)


@pytest.mark.usefixtures("own_signals")
@pytest.mark.parametrize(("failures", "status"), [({}, 0), ({THREE[0].name: GraphError("no answer")}, 1)])
def test_the_command_writes_summary_and_report_either_way(failures, status, monkeypatch, tmp_path, capsys):
    @contextlib.contextmanager
    def scripted(*_):
        yield ScriptedRunner(failures)

    # The command sets its process's environment, which here is the tests' process.
    monkeypatch.setenv("ROS_DOMAIN_ID", "0")
    monkeypatch.setattr(demo, "environment", dict)
    monkeypatch.setattr(demo, "_runner", scripted)
    monkeypatch.setattr(demo, "_commands", lambda *_: {})
    assert main(["demo", "--short", "--out", str(tmp_path)]) == status
    stored = json.loads((tmp_path / "summary.json").read_text())
    assert stored["passed"] is (status == 0)
    assert stored["stations"][0]["reason"] == ("no answer" if failures else "")
    assert ("no answer" in (tmp_path / "report.html").read_text()) is bool(failures)
    printed = capsys.readouterr()
    assert printed.err == ""
    assert f"{3 - status} of 3 stations verged" in printed.out
    assert "60 s of simulated time passed at 0.6 of real time" in printed.out
    assert stored["real_time_factor"] == 0.6
