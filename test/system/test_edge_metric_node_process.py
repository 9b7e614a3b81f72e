"""edge_metric_node as users start it: the installed executable, the shipped YAML, signals, and broken YAML."""

import os
import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.task import Future

from vergence_bringup.ros.processes import find_node

pytestmark = pytest.mark.system

CONFIG = Path(__file__).resolve().parents[2] / "config" / "edge_metric_node.yaml"


def command(*arguments: str) -> list[str]:
    return [str(find_node("edge_metric_node")), "--ros-args", *arguments]


@contextmanager
def running(*arguments: str) -> Iterator["subprocess.Popen[str]"]:
    process = subprocess.Popen(command(*arguments), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        yield process
    finally:
        if process.poll() is None:
            process.kill()
        process.communicate()


def wait_for_diagnostics(domain_id: int) -> None:
    """Return once the node reports on itself."""
    context = Context()
    rclpy.init(args=[], context=context, domain_id=domain_id)
    node, executor = Node("listener", context=context), SingleThreadedExecutor(context=context)
    executor.add_node(node)
    heard = Future(executor=executor)

    def receive(message: DiagnosticArray) -> None:
        if not heard.done() and any(status.name.startswith("edge_metric_node") for status in message.status):
            heard.set_result(True)

    node.create_subscription(DiagnosticArray, "/diagnostics", receive, 10)
    try:
        executor.spin_until_future_complete(heard, timeout_sec=90.0)
        assert heard.done(), "no diagnostics within 90 s"
    finally:
        executor.shutdown()
        node.destroy_node()
        context.try_shutdown()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_starts_with_the_shipped_yaml_and_ends_cleanly(domain_id: int, number: signal.Signals) -> None:
    with running("--params-file", str(CONFIG)) as process:
        wait_for_diagnostics(domain_id)
        process.send_signal(number)
        out, err = process.communicate(timeout=90)
    assert process.returncode == 0, err
    assert "Traceback" not in out + err


@pytest.mark.parametrize(
    ("yaml", "complaint"),
    [
        (
            "/**: {ros__parameters: {pair: {slop_s: soon}}}",
            "parameter 'pair.slop_s' must be a number",
        ),
        (
            "/**: {ros__parameters: {edges: {blur_sigma_px: -1.0}}}",
            "parameter 'edges.blur_sigma_px' must be a number",
        ),
        ("/**: {ros__parameters: {edges: {windows_px: [50, 0]}}}", "parameter 'edges.windows_px' must be a list"),
        (
            "/**: {ros__parameters: {edges: {canny_low: 90.0}}}",
            "parameter 'edges.canny_low' must be at most canny_high",
        ),
        ("/**: {ros__parameters: {windows: [50]}}", "there is no parameter 'windows': its name must be one of "),
        (
            "/**: {ros__parameters: {track_saccade_deg: 2.0}}",
            "parameter 'track_saccade_deg' was renamed: set 'tracker.saccade_rad' (in rad) instead",
        ),
        ("/**: {ros__parameters: {rig: /nowhere/rig.yaml}}", "/nowhere/rig.yaml"),
        ("{ not: [yaml", "is not YAML"),
    ],
    ids=[
        "mistyped",
        "out_of_range",
        "out_of_range_in_a_list",
        "contradicting",
        "unknown",
        "renamed",
        "no_rig",
        "not_yaml",
    ],
)
def test_a_bad_yaml_ends_with_status_2_and_one_line(tmp_path: Path, domain_id: int, yaml: str, complaint: str) -> None:
    path = tmp_path / "bad.yaml"
    path.write_text(yaml + "\n")
    # rcl prints a line of its own about YAML that it cannot parse
    quiet = os.environ | {"RCUTILS_LOGGING_MIN_SEVERITY": "FATAL"}
    done = subprocess.run(command("--params-file", str(path)), capture_output=True, text=True, timeout=90, env=quiet)
    ours = [line for line in done.stderr.splitlines() if not line.startswith("[ERROR]")]
    assert done.returncode == 2
    assert len(ours) == 1, done.stderr
    assert ours[0].startswith("edge_metric_node: ")
    assert complaint in ours[0]
