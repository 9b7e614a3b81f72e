"""The page in a real browser: a headless Chromium before the running simulated head."""

import asyncio
from collections.abc import Awaitable, Callable, Iterator
from pathlib import Path
from typing import Any, TypeVar

import pytest

from vergence_bringup.page_address import page_address
from vergence_bringup.ros.processes import NodeCommand, ProcessGroup, config_dir
from vergence_bringup.ros.simulated_head import simulated_head
from vergence_common.domains import own_domain
from vergence_rig.rig_file import load_rig, write_rig
from vergence_sim.heads import HeadParameters
from vergence_sim.heads import simulated_head as simulated_rig
from vergence_web.testing.chromium import Chromium, Tab, chromium, find_chromium

pytestmark = pytest.mark.system

Result = TypeVar("Result")

STARTED_S, VERGED_S = 180.0, 120.0
PHONE = (390, 844)


class Head:
    """A simulated head as processes, in simulated time, and its page; the controller can be started anew."""

    def __init__(self, folder: Path, domain: int) -> None:
        self._folder, self._environment = folder, {"ROS_DOMAIN_ID": str(domain)}
        self._shared: dict[str, object] = {"use_sim_time": True}
        self.nodes = ProcessGroup(folder / "log", self._environment)
        self.controllers = ProcessGroup(folder / "log", self._environment)
        self.pages = ProcessGroup(folder / "log", self._environment)

    def start(self) -> None:
        # As it is built: what the page shows of angles and distances is then true.
        rig = self._folder / "rig.yaml"
        write_rig(rig, simulated_rig(HeadParameters(), load_rig(config_dir() / "rig.yaml")))
        self._shared["rig"] = str(rig)
        commands = simulated_head(rig, simulated_time=True, **{"clock.stepped": False})
        self.controller = commands.pop("gaze_controller_node")
        del commands["eye_rotation_node"]
        for name, command in commands.items():
            self.nodes.start(name, command)
        self.controllers.start("gaze_controller_node", self.controller)
        self.url = self.start_page("web_node", port=0)

    def start_page(self, log: str, **parameters: object) -> str:
        """Start a web_node and return the first address that it prints."""
        self.pages.start(log, NodeCommand.of("web_node", {**self._shared, **parameters}))
        return page_address(self._folder / "log" / f"{log}.log", self.pages.check)

    def stop(self) -> None:
        for group in (self.pages, self.controllers, self.nodes):
            group.stop()


class Browser:
    """A Chromium and its loop."""

    def __init__(self, path: str) -> None:
        self._loop = asyncio.new_event_loop()
        self._context = chromium(path)
        self._chromium: Chromium = self._loop.run_until_complete(self._context.__aenter__())

    def run(self, visit: Callable[[Chromium], Awaitable[Result]]) -> Result:
        return self._loop.run_until_complete(visit(self._chromium))

    def close(self) -> None:
        self._loop.run_until_complete(self._context.__aexit__(None, None, None))
        self._loop.close()


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    path = find_chromium()
    if path is None:
        pytest.skip("no Chromium is installed here")
    one = Browser(path)
    yield one
    one.close()


@pytest.fixture(scope="module")
def head(browser: Browser, opengl: None, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Head]:
    pytest.importorskip("onnxruntime", reason="onnxruntime is not installed here")
    with own_domain() as domain:
        one = Head(tmp_path_factory.mktemp("page"), domain)
        try:
            one.start()
            yield one
        finally:
            one.stop()


async def opened(running: Chromium, url: str, width: int = 1280, height: int = 800) -> Tab:
    """Return a page that shows images, a state and detections."""
    tab = await running.tab(width, height)
    await tab.open(url)
    await tab.wait_for(
        "window.vergence?.images.left > 2 && vergence.images.right > 2 && vergence.samples > 2", STARTED_S
    )
    return tab


def canvas_sum(selector: str) -> str:
    """Return a JavaScript expression of a canvas's content, different for different pictures."""
    return (
        f"(() => {{ const c = document.querySelector({selector!r}); "
        "const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data; "
        "let s = 0; for (let i = 0; i < d.length; i += 7) s = (s * 31 + d[i]) % 4294967291; return s; })()"
    )


LEFT_IMAGE = "figure[data-eye=left] .image"


def test_images_and_charts_move_without_errors(head: Head, browser: Browser) -> None:
    async def visit(running: Chromium) -> None:
        tab = await opened(running, head.url)
        for canvas in (LEFT_IMAGE, "figure[data-eye=right] .image", "[data-chart=Vergence] canvas"):
            before = await tab.value(canvas_sum(canvas))
            await tab.wait_for(f"{canvas_sum(canvas)} !== {before}")
        assert "waiting" not in await tab.value("document.getElementById('phase').textContent")
        assert await tab.value("document.getElementById('reason').textContent.length") > 5
        assert await tab.value("document.querySelectorAll('#rates tr').length") > 8
        for mode in ("anaglyph", "blend", "edges"):
            await tab.click(f"[data-mode={mode}]")
            before = await tab.value(canvas_sum(LEFT_IMAGE))
            await tab.wait_for(f"{canvas_sum(LEFT_IMAGE)} !== {before}")
        await tab.wait_for("vergence.images.edges > 1")
        assert tab.errors == []
        await tab.close()

    browser.run(visit)


def test_a_click_verges_the_head(head: Head, browser: Browser) -> None:
    async def visit(running: Chromium) -> dict[str, Any]:
        tab = await opened(running, head.url)
        box = await tab.wait_for("vergence.state.detections?.left[0]", STARTED_S)
        width, height = await tab.value("vergence.state.eyes[0].size")
        left, top, right, bottom = box["xyxy"]
        middle = 0.5 * (left + right + 1) / width, 0.5 * (top + bottom + 1) / height
        await tab.click("figure[data-eye=left] .marks", *middle)
        await tab.wait_for("document.getElementById('goal').dataset.result", VERGED_S)
        assert "VERGED" in await tab.value("document.getElementById('goal').textContent")
        await tab.wait_for("!document.getElementById('verged').hidden", VERGED_S)
        state: dict[str, Any] = await tab.value("vergence.state")
        assert tab.errors == []
        await tab.click("#stop")
        await tab.wait_for("document.getElementById('goal').textContent.includes('stopped')")
        await tab.close()
        return state

    state = browser.run(visit)
    # The cube stands half a metre or more before the head: its fixation needs some degrees.
    assert state["gaze"]["vergence_rad"] > 0.03
    for eye, marks in zip(("left", "right"), state["eyes"], strict=True):
        near = [
            abs(point - fovea) < 40 for point, fovea in zip(state["track"][eye], marks["fovea"], strict=True) if point
        ]
        assert near == [True, True], (eye, state["track"], marks["fovea"])


def test_buttons_and_boxes_are_goals(head: Head, browser: Browser) -> None:
    async def visit(running: Chromium) -> None:
        tab = await opened(running, head.url)
        await tab.wait_for("!document.getElementById('centre').disabled")
        assert await tab.value("document.getElementById('park').disabled")  # the simulator has no servo_node
        await tab.click("#centre")
        await tab.wait_for("document.getElementById('goal').dataset.result === 'VERGED'", VERGED_S)
        assert abs(await tab.value("vergence.state.gaze.version_rad")) < 0.03
        await tab.drag("figure[data-eye=left] .marks", (0.3, 0.3), (0.5, 0.6))
        goal = "document.getElementById('goal').textContent"
        await tab.wait_for(f"{goal}.startsWith('Look at what is in the box')")
        await tab.wait_for(f"!{goal}.endsWith('sent')")
        await tab.call("Input.dispatchKeyEvent", type="keyDown", key="Escape")
        await tab.wait_for(f"{goal} === 'Stop: stopped: the eyes hold still'")
        assert tab.errors == []
        await tab.close()

    browser.run(visit)


def test_two_pages_at_once_and_one_that_goes(head: Head, browser: Browser) -> None:
    async def visit(running: Chromium) -> None:
        one, other = await opened(running, head.url), await opened(running, head.url)
        for tab in (one, other):
            seen = await tab.value("vergence.images.left")
            await tab.wait_for(f"vergence.images.left > {seen} + 2")
        await other.close()
        seen = await one.value("vergence.images.left")
        await one.wait_for(f"vergence.images.left > {seen} + 2")
        assert one.errors == []
        await one.close()

    browser.run(visit)


def test_a_controller_that_is_started_anew(head: Head, browser: Browser) -> None:
    async def visit(running: Chromium) -> None:
        tab = await opened(running, head.url)
        head.controllers.stop()
        await tab.wait_for("document.getElementById('phase').textContent === 'no state'")
        assert "gaze_controller_node sends no state" in await tab.value("document.getElementById('reason').textContent")
        await tab.wait_for("document.getElementById('centre').disabled")
        head.controllers.start("gaze_controller_node", head.controller)
        await tab.wait_for("document.getElementById('phase').textContent === 'idle'", STARTED_S)
        await tab.wait_for("!document.getElementById('centre').disabled", STARTED_S)
        await tab.click("#hold")
        goal = "document.getElementById('goal')"
        await tab.wait_for(f"{goal}.matches('.good, .bad')", VERGED_S)
        assert await tab.value(f"{goal}.dataset.result"), await tab.value(f"{goal}.textContent")
        assert tab.errors == []
        await tab.close()

    browser.run(visit)


def test_parameters_are_edited(head: Head, browser: Browser) -> None:
    async def visit(running: Chromium) -> None:
        tab = await opened(running, head.url)
        await tab.click("[data-tab=parameters]")
        await tab.wait_for("[...document.querySelectorAll('#parameters option')].some((o) => o.value === '/web_node')")
        await tab.value(
            "(() => { const s = document.querySelector('#parameters select'); s.value = '/web_node'; "
            "s.dispatchEvent(new Event('change')); })()"
        )
        row = "[data-parameter=image_rate_hz]"
        await tab.wait_for(f"document.querySelector({row!r}) !== null")
        assert "largest rate" in await tab.value(f"document.querySelector({row + ' .about'!r}).textContent")
        assert await tab.value("document.querySelector('[data-parameter=port] input').disabled")
        said = f"document.querySelector({row + ' .said'!r}).textContent"
        for value, answer in (("12.5", "=== 'set'"), ("500", ".includes('must be a number from 1 to 60')")):
            await tab.value(
                f"(() => {{ const i = document.querySelector({row + ' input'!r}); i.value = '{value}'; "
                "i.dispatchEvent(new Event('change')); })()"
            )
            await tab.wait_for(said + answer)
        assert tab.errors == []
        await tab.close()

    browser.run(visit)


def overlaps() -> str:
    """Return a JavaScript expression: pairs of the page's parts that overlap, or leave the screen to the right."""
    return """(() => {
      const parts = 'section, .buttons button, .bar button, figure, .chart';
      const shown = [...document.querySelectorAll(parts)].filter((e) => e.offsetParent);
      const boxes = shown.map((e) => e.getBoundingClientRect());
      const name = (e) => e.id || e.textContent.trim().slice(0, 20) || e.tagName;
      const found = [];
      for (let i = 0; i < shown.length; i += 1) {
        if (boxes[i].right > window.innerWidth + 1) found.push(`${name(shown[i])} leaves the screen`);
        for (let j = i + 1; j < shown.length; j += 1) {
          if (shown[i].contains(shown[j]) || shown[j].contains(shown[i])) continue;
          const [a, b] = [boxes[i], boxes[j]];
          const wide = Math.min(a.right, b.right) - Math.max(a.left, b.left);
          const high = Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
          if (wide > 1.5 && high > 1.5) found.push(`${name(shown[i])} over ${name(shown[j])}`);
        }
      }
      return found;
    })()"""


@pytest.mark.parametrize(
    ("width", "height", "phone"), [(*PHONE, True), (844, 390, True), (1280, 800, False), (2200, 1200, False)]
)
def test_nothing_overlaps_at_any_size(head: Head, browser: Browser, width: int, height: int, phone: bool) -> None:
    async def visit(running: Chromium) -> None:
        tab = await opened(running, head.url, width, height)
        await tab.set_size(width, height, 2.0 if phone else 1.0, phone)
        for tab_name in ("diagnostics", "parameters", "rates"):
            await tab.click(f"[data-tab={tab_name}]")
            await tab.wait_for(f"!document.getElementById('{tab_name}').hidden")
            assert await tab.value(overlaps()) == []
            assert await tab.value("document.documentElement.scrollWidth <= window.innerWidth")
        heights = await tab.value("[...document.querySelectorAll('.buttons button')].map((b) => b.offsetHeight)")
        assert min(heights) >= 44
        assert tab.errors == []
        await tab.close()

    browser.run(visit)


def test_a_finger_taps_and_draws_a_box(head: Head, browser: Browser) -> None:
    async def visit(running: Chromium) -> None:
        tab = await opened(running, head.url, *PHONE)
        await tab.set_size(*PHONE, 2.0, True)
        goal = "document.getElementById('goal').textContent"
        marks = "figure[data-eye=right] .marks"
        await tab.touch(marks, (0.5, 0.5))
        await tab.wait_for(f"/^Look at pixel [0-9]+, [0-9]+ of the right eye: (?!sent)/.test({goal})")
        await tab.click("#draw-box")
        await tab.touch(marks, (0.3, 0.3), (0.5, 0.4), (0.7, 0.7))
        await tab.wait_for(f"/^Look at what is in the box: (?!sent)/.test({goal})")
        await tab.click("#stop")
        await tab.wait_for(f"{goal} === 'Stop: stopped: the eyes hold still'")
        assert tab.errors == []
        await tab.close()

    browser.run(visit)


def test_a_page_for_other_machines_needs_its_token(head: Head, browser: Browser) -> None:
    url = head.start_page("web_node_for_all", port=0, address="0.0.0.0")
    port, token = url.partition("http://")[2].rpartition(":")[2].split("/?token=")
    assert len(token) >= 16

    async def visit(running: Chromium) -> None:
        tab = await running.tab()
        await tab.open(f"http://127.0.0.1:{port}/")
        assert "needs its token" in await tab.wait_for("document.body?.textContent")
        await tab.close()
        tab = await opened(running, f"http://127.0.0.1:{port}/?token={token}")
        assert await tab.value("location.search") == ""
        assert tab.errors == []
        await tab.close()

    browser.run(visit)


def test_a_page_whose_server_is_started_anew(head: Head, browser: Browser) -> None:
    async def visit(running: Chromium) -> None:
        tab = await opened(running, head.url)
        port = int(head.url.rstrip("/").rpartition(":")[2])
        head.pages.stop()
        await tab.wait_for("document.getElementById('link').textContent.startsWith('web_node is gone')")
        head.start_page("web_node_anew", port=port)
        await tab.wait_for("document.getElementById('link').textContent === 'connected'")
        seen = await tab.value("vergence.images.left")
        await tab.wait_for(f"vergence.images.left > {seen} + 2", STARTED_S)
        await tab.close()

    browser.run(visit)
