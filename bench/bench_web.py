"""The page: what web_node costs without and with a viewer, how late its images are, how soon a click is a goal.

Two cameras that replay photographs as JPEG at 640x480, 30 Hz, with edge metric, controller and fake servos; the viewer
is a headless Chromium on the same machine. Latency: from an image's stamp to the frame in which the page draws it, and
from the same stamp to the image's arrival at a bare subscriber of left/image_raw. A click is a goal once its acceptance
is back in the page.
"""

import asyncio
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import median
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import Image

from bench.budget_recording import record
from bench.budget_run import cameras
from bench.photos_data import NoPhotographsError
from bench.process_cost import cpu_s
from bench.results import OUT_DIR, Row
from vergence_bringup.page_address import page_address
from vergence_bringup.ros.processes import NodeCommand, ProcessGroup
from vergence_common.domains import own_domain
from vergence_common.qos import IMAGE_QOS
from vergence_common.stamps import to_nanoseconds
from vergence_web.testing.chromium import BrowserError, Tab, chromium, find_chromium

SETTLED_S, MEASURED_S = 8.0, 20.0
CLICKS = 12
_CLICK_EVERY_S = 0.7
_STARTED_S = 60.0


def run(say: Callable[[str], None]) -> list[Row]:
    """Measure without a viewer, then with one."""
    browser = find_chromium()
    if browser is None:
        say("skipped: no Chromium is installed")
        return []
    with tempfile.TemporaryDirectory() as folder:
        try:
            folders = record(Path(folder))
        except NoPhotographsError as error:
            say(f"skipped: {error}")
            return []
        with own_domain() as domain, ProcessGroup(OUT_DIR / "web_logs", {"ROS_DOMAIN_ID": str(domain)}) as nodes:
            for name, command in cameras(folders).items():
                nodes.start(name, command)
            nodes.start("servo_node", NodeCommand.of("servo_node", {"backend": "fake"}))
            for name in ("edge_metric_node", "gaze_controller_node"):
                nodes.start(name, NodeCommand.of(name))
            nodes.start("web_node", NodeCommand.of("web_node", {"port": 0}))
            url = page_address(OUT_DIR / "web_logs" / "web_node.log", nodes.check)
            with _bare_subscriber(domain) as arrivals:
                return _measured(say, nodes, browser, url, arrivals)


def _measured(
    say: Callable[[str], None], nodes: ProcessGroup, browser: str, url: str, arrivals: dict[int, float]
) -> list[Row]:
    end_s = time.monotonic() + _STARTED_S
    while not arrivals:
        nodes.check()
        if time.monotonic() > end_s:
            raise RuntimeError(f"no image arrived within {_STARTED_S:g} s")
        time.sleep(0.1)
    time.sleep(SETTLED_S)
    pid = nodes.pid("web_node")
    say("no viewer")
    idle = _share(pid)
    say("one viewer")
    viewer, drawn, clicks_ms = asyncio.run(_viewed(nodes, pid, browser, url))
    both = [(seconds, arrivals[stamp]) for stamp, seconds in drawn if stamp in arrivals]
    say(f"{len(drawn)} images drawn, {len(both)} of them received by the bare subscriber; {len(clicks_ms)} clicks")
    peer = "arrival of the same images at a bare subscriber"
    nan = float("nan")
    return [
        Row("web.cpu_idle", idle, "of a core"),
        Row("web.cpu_viewer", viewer, "of a core"),
        Row("web.latency_ms", *(_median_ms(one[0] for one in both), "ms", peer, _median_ms(one[1] for one in both))),
        Row("web.click_to_goal_ms", median(clicks_ms) if clicks_ms else nan, "ms"),
    ]


def _median_ms(values_s: Iterator[float]) -> float:
    found = list(values_s)
    return 1e3 * median(found) if found else float("nan")


def _share(pid: int) -> float:
    before, began = cpu_s(pid), time.monotonic()
    time.sleep(MEASURED_S)
    return (cpu_s(pid) - before) / (time.monotonic() - began)


async def _viewed(
    nodes: ProcessGroup, pid: int, browser: str, url: str
) -> tuple[float, list[tuple[int, float]], list[float]]:
    """Return web_node's share of a core, (stamp [ns], latency [s]) of drawn images, and times of clicks [ms]."""
    async with chromium(browser) as running:
        tab = await running.tab(1280, 800)
        await tab.open(url)
        await tab.wait_for("window.vergence && vergence.images.left > 5 && vergence.samples > 5", _STARTED_S)
        await asyncio.sleep(SETTLED_S)
        await tab.value("vergence.latencies = []")
        before, began = cpu_s(pid), time.monotonic()
        await asyncio.sleep(MEASURED_S)
        share = (cpu_s(pid) - before) / (time.monotonic() - began)
        nodes.check()
        left = "vergence.latencies.filter((one) => one.eye === 'left')"
        drawn = [(int(one["stamp"]), float(one["seconds"])) for one in await tab.value(left)]
        return share, drawn, [await _click(tab, number) for number in range(CLICKS)]


async def _click(tab: Tab, number: int) -> float:
    """Return how long a click took to become an accepted goal [ms]."""
    await tab.value("delete vergence.control.acceptedAfterMs")
    await tab.click("figure[data-eye=left] .marks", 0.4 + 0.02 * number, 0.5)
    try:
        took: Any = await tab.wait_for("vergence.control.acceptedAfterMs", 10.0)
    except BrowserError:
        return float("inf")
    await asyncio.sleep(_CLICK_EVERY_S)
    return float(took)


@contextmanager
def _bare_subscriber(domain: int) -> Iterator[dict[int, float]]:
    """Yield the age of each left image [s] when it arrived, by its stamp [ns]."""
    context = Context()
    rclpy.init(args=[], context=context, domain_id=domain)
    node, executor = Node("bare_subscriber", context=context), SingleThreadedExecutor(context=context)
    ages_s: dict[int, float] = {}

    def receive(message: Image) -> None:
        stamp_ns = to_nanoseconds(message.header.stamp)
        ages_s[stamp_ns] = (time.time_ns() - stamp_ns) * 1e-9

    node.create_subscription(Image, "left/image_raw", receive, IMAGE_QOS)
    executor.add_node(node)
    thread = threading.Thread(target=executor.spin, daemon=True)
    thread.start()
    try:
        yield ages_s
    finally:
        executor.shutdown()
        thread.join(5.0)
        node.destroy_node()
        context.try_shutdown()
