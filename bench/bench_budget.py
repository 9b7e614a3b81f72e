"""Each node's share of a core and memory: JPEG recordings of photographs at 640x480, 30 Hz, to fake servos.

Every node is measured in the graph with the nodes that feed it, as a process of its own. Beside it stands an empty
rclpy node with the same subscriptions: what rclpy and the middleware cost without any of our code. A metric node
without subscribers measures nothing, so that each has one: in the loop the controller, else an empty node.
"""

import tempfile
from collections.abc import Callable
from pathlib import Path

from bench.budget_recording import record
from bench.budget_run import IDLE_S, HeadCommand, Share, cameras, measure
from bench.photos_data import NoPhotographsError
from bench.results import Row
from vergence_bringup.ros.processes import NodeCommand

EMPTY = "an empty rclpy node with the same subscriptions"
READERS = {"box_metric_node": "box_reader", "eye_rotation_node": "eye_rotation_reader"}
LOOP = ("edge_metric_node", "gaze_controller_node", "servo_node")


def run(say: Callable[[str], None]) -> list[Row]:
    """Measure the loop, then each of the other metric nodes."""
    with tempfile.TemporaryDirectory() as folder:
        try:
            folders = record(Path(folder))
        except NoPhotographsError as error:
            say(f"skipped: {error}")
            return []
        eyes = cameras(folders)
        servo = {"servo_node": NodeCommand.of("servo_node", {"backend": "fake"})}
        say("the loop: cameras, edge metric, controller, servos")
        loop = measure(eyes | servo | {name: NodeCommand.of(name) for name in LOOP[:2]}, goal=True)
        alone: dict[str, Share] = {}
        for name, reader in READERS.items():
            say(f"{name}, cameras and a subscriber")
            alone |= measure(eyes | servo | {name: NodeCommand.of(name)}, (reader,))
        say("the loop beside empty nodes")
        empty = measure(
            eyes | servo | {name: NodeCommand.of(name) for name in LOOP[:2]},
            ("metric", "controller", "servo"),
            goal=True,
        )
        say("no goal, and nothing else reads anything: the same nodes")
        idle = measure(eyes | servo | {name: NodeCommand.of(name) for name in LOOP[:2]}, settled_s=IDLE_S)
        say("the loop in one process, with and without a goal")
        composed = measure({"head_node": HeadCommand(folders)}, goal=True)
        composed_idle = measure({"head_node": HeadCommand(folders)}, settled_s=IDLE_S)
    kinds = dict.fromkeys(("edge_metric_node", "box_metric_node", "eye_rotation_node"), "metric")
    kinds |= {"gaze_controller_node": "controller", "servo_node": "servo"}
    shares = alone | loop
    rows = []
    for name in (*kinds, "camera_node"):
        share = _camera(shares) if name == "camera_node" else shares[name]
        core, memory = f"budget.{name}.core_share", f"budget.{name}.rss_mb"
        if name in kinds:
            peer = empty[f"empty.{kinds[name]}"]
            rows.append(Row(core, share.core, "of a core", EMPTY, peer.core))
            rows.append(Row(memory, share.rss_mb, "MB", EMPTY, peer.rss_mb))
        else:
            rows += [Row(core, share.core, "of a core"), Row(memory, share.rss_mb, "MB")]
    separate = _total(loop)
    rows.append(Row("budget.composed.core_share", _total(composed), "of a core", "a process for each node", separate))
    rows.append(
        Row("budget.composed.rss_mb", composed["head_node"].rss_mb, "MB", "a process for each node", _memory(loop))
    )
    rows.append(Row("budget.separate.core_share", separate, "of a core"))
    rows.append(
        Row("budget.idle.core_share", _total(idle), "of a core", "the same in one process", _total(composed_idle))
    )
    return rows


def _camera(shares: dict[str, Share]) -> Share:
    both = [share for name, share in shares.items() if name.startswith("camera_node")]
    return Share(sum(one.core for one in both) / len(both), max(one.rss_mb for one in both))


def _memory(shares: dict[str, Share]) -> float:
    return sum(share.rss_mb for share in shares.values())


def _total(shares: dict[str, Share]) -> float:
    return sum(share.core for share in shares.values())
