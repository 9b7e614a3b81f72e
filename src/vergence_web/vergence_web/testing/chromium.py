"""A headless Chromium, driven by its DevTools protocol: pages are opened, clicked, read, and drawn as pictures."""

import asyncio
import base64
import contextlib
import itertools
import os
import shutil
import tempfile
import time
from collections.abc import AsyncIterator, Iterator
from pathlib import Path
from typing import Any

import aiohttp

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
"""Executables that are looked for, in this order."""
_STARTED_WITHIN_S, _ANSWERED_WITHIN_S = 60.0, 60.0
_LOOK_S = 0.02
_CLICKS, _PRESSED_WITHIN_S = 6, 5.0
_LARGEST_MESSAGE = 256 * 1024 * 1024


class BrowserError(RuntimeError):
    """The browser did not start, did not answer, or the page did not do what was waited for."""


def find_chromium() -> str | None:
    """Return the path of a Chromium, None where there is none; VERGENCE_CHROMIUM names another one."""
    return os.environ.get("VERGENCE_CHROMIUM") or next(filter(None, map(shutil.which, NAMES)), None)


class Tab:
    """One page of a browser."""

    def __init__(self, browser: "Chromium", session: str) -> None:
        self._browser, self._session = browser, session
        self.errors: list[str] = []
        """Exceptions, errors on the console, and failed requests of the page."""

    async def call(self, method: str, **parameters: Any) -> Any:
        """Call a method of the protocol."""
        return await self._browser.call(method, parameters, self._session)

    async def set_size(self, width_px: int, height_px: int, scale: float = 1.0, phone: bool = False) -> None:
        """Give the page the size of a screen; `phone` has it touched, not clicked."""
        await self.call(
            "Emulation.setDeviceMetricsOverride",
            width=width_px,
            height=height_px,
            deviceScaleFactor=scale,
            mobile=phone,
        )
        await self.call("Emulation.setTouchEmulationEnabled", enabled=phone)

    async def open(self, url: str) -> None:
        """Load a page."""
        answer = await self.call("Page.navigate", url=url)
        if answer.get("errorText"):
            raise BrowserError(f"{url} cannot be opened: {answer['errorText']}")

    async def value(self, expression: str) -> Any:
        """Return the value of a JavaScript expression. Raises BrowserError where it throws."""
        answer = await self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in answer:
            raise BrowserError(f"{expression}: {answer['exceptionDetails']}")
        return answer["result"].get("value")

    async def wait_for(self, expression: str, timeout_s: float = 30.0) -> Any:
        """Return the value of a JavaScript expression once it is true. Raises BrowserError after `timeout_s`."""
        end_s = time.monotonic() + timeout_s
        while True:
            try:
                value = await self.value(expression)
            except BrowserError:
                value = None  # the page is not there yet
            if value:
                return value
            if time.monotonic() > end_s:
                raise BrowserError(f"not within {timeout_s:g} s: {expression}; errors of the page: {self.errors}")
            await asyncio.sleep(_LOOK_S)

    async def place_of(self, selector: str, across: float = 0.5, down: float = 0.5) -> tuple[float, float]:
        """Return a point (x, y) [CSS px] of an element, scrolled into view: shares of its width and height."""
        box = await self.value(
            f"(() => {{ const e = document.querySelector({selector!r}); e.scrollIntoView({{block: 'center'}}); "
            "const b = e.getBoundingClientRect(); return [b.left, b.top, b.width, b.height]; })()"
        )
        return box[0] + across * box[2], box[1] + down * box[3]

    async def click(self, selector: str, across: float = 0.5, down: float = 0.5) -> None:
        """Click a point of an element. Raises BrowserError where the element never receives it.

        What is under the point may have moved since its place was asked for, and a busy browser drops a click.
        """
        for _ in range(_CLICKS):
            await self.value(
                f"document.querySelector({selector!r}).addEventListener("
                "'pointerdown', () => { window.pressed = true; }, { once: true }); window.pressed = false"
            )
            x, y = await self.place_of(selector, across, down)
            for kind in ("mousePressed", "mouseReleased"):
                await self._mouse(kind, x, y)
            with contextlib.suppress(BrowserError):
                await self.wait_for("window.pressed", _PRESSED_WITHIN_S)
                return
        there = await self.value(f"document.elementFromPoint({x}, {y})?.outerHTML.slice(0, 200)")
        raise BrowserError(f"{selector} receives no click at ({x:g}, {y:g}): what lies there is {there}")

    async def drag(self, selector: str, start: tuple[float, float], end: tuple[float, float]) -> None:
        """Drag between two points of an element, shares of its width and height."""
        await self._mouse("mousePressed", *await self.place_of(selector, *start))
        await self._mouse("mouseMoved", *await self.place_of(selector, *end))
        await self._mouse("mouseReleased", *await self.place_of(selector, *end))

    async def touch(self, selector: str, *places: tuple[float, float]) -> None:
        """Put a finger on the first of some places of an element, move it over the others, and lift it."""
        for i, place in enumerate(places):
            x, y = await self.place_of(selector, *place)
            kind = "touchMove" if i else "touchStart"
            await self.call("Input.dispatchTouchEvent", type=kind, touchPoints=[{"x": x, "y": y}])
        await self.call("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])

    async def _mouse(self, kind: str, x: float, y: float) -> None:
        await self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", buttons=1, clickCount=1)

    async def screenshot(self, path: Path, whole: bool = False) -> None:
        """Write what is seen, or the whole page, as PNG, or as JPEG where the path ends so."""
        jpeg = {"format": "jpeg", "quality": 85} if path.suffix == ".jpg" else {"format": "png"}
        answer = await self.call("Page.captureScreenshot", captureBeyondViewport=whole, **jpeg)
        path.write_bytes(base64.b64decode(answer["data"]))

    async def close(self) -> None:
        """Close the page."""
        await self.call("Page.close")


class Chromium:
    """A running browser; made by `chromium`."""

    def __init__(self, socket: aiohttp.ClientWebSocketResponse) -> None:
        self._socket = socket
        self._numbers = itertools.count(1)
        self._answers: dict[int, asyncio.Future[Any]] = {}
        self._tabs: dict[str, Tab] = {}
        self._receiving = asyncio.get_running_loop().create_task(self._receive())

    async def tab(self, width_px: int = 1280, height_px: int = 800) -> Tab:
        """Return a new, empty page."""
        target = await self.call("Target.createTarget", {"url": "about:blank", "newWindow": True})
        attached = await self.call("Target.attachToTarget", {"targetId": target["targetId"], "flatten": True})
        tab = self._tabs[attached["sessionId"]] = Tab(self, attached["sessionId"])
        for domain in ("Page", "Runtime", "Log", "Network"):
            await tab.call(f"{domain}.enable")
        await tab.set_size(width_px, height_px)
        return tab

    async def call(self, method: str, parameters: dict[str, Any] | None = None, session: str | None = None) -> Any:
        """Call a method of the protocol and return its result. Raises BrowserError."""
        number = next(self._numbers)
        future = self._answers[number] = asyncio.get_running_loop().create_future()
        about = {"sessionId": session} if session else {}
        await self._socket.send_json({"id": number, "method": method, "params": parameters or {}, **about})
        try:
            answer = await asyncio.wait_for(future, _ANSWERED_WITHIN_S)
        except (asyncio.TimeoutError, TimeoutError):
            raise BrowserError(f"the browser does not answer {method} within {_ANSWERED_WITHIN_S:g} s") from None
        if "error" in answer:
            raise BrowserError(f"{method}: {answer['error']}")
        return answer["result"]

    async def close(self) -> None:
        """Ask the browser to end."""
        with contextlib.suppress(BrowserError, ConnectionError):
            await self.call("Browser.close")
        self._receiving.cancel()

    async def _receive(self) -> None:
        async for received in self._socket:
            message = received.json()
            if "id" in message:
                future = self._answers.pop(message["id"], None)
                if future is not None and not future.done():
                    future.set_result(message)
            elif message.get("sessionId") in self._tabs:
                self._tabs[message["sessionId"]].errors.extend(_errors(message))
        for future in self._answers.values():
            if not future.done():
                future.set_exception(BrowserError("the browser has gone"))


def _errors(event: dict[str, Any]) -> Iterator[str]:
    """Yield what an event says went wrong in a page."""
    method, parameters = event["method"], event["params"]
    if method == "Runtime.exceptionThrown":
        details = parameters["exceptionDetails"]
        yield details.get("exception", {}).get("description") or details["text"]
    elif method == "Runtime.consoleAPICalled" and parameters["type"] in ("error", "assert"):
        yield " ".join(str(argument.get("value", argument.get("description"))) for argument in parameters["args"])
    elif method == "Log.entryAdded" and parameters["entry"]["level"] == "error":
        yield f"{parameters['entry']['text']} {parameters['entry'].get('url', '')}".strip()


@contextlib.asynccontextmanager
async def chromium(path: str) -> AsyncIterator[Chromium]:
    """Run a headless Chromium. Raises BrowserError where it does not start."""
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        arguments = [
            "--headless=new",
            "--remote-debugging-port=0",
            f"--user-data-dir={profile}",
            "--no-first-run",
            "--disable-background-networking",
            "--disable-gpu",
            "--disable-dev-shm-usage",
            # Pages that are covered by another one are drawn all the same.
            "--disable-backgrounding-occluded-windows",
            "--disable-renderer-backgrounding",
            *(["--no-sandbox"] if os.geteuid() == 0 else []),
            "about:blank",
        ]
        process = await asyncio.create_subprocess_exec(
            path, *arguments, stdout=asyncio.subprocess.DEVNULL, stderr=asyncio.subprocess.PIPE
        )
        try:
            url = await asyncio.wait_for(_address(process), _STARTED_WITHIN_S)
            draining = asyncio.get_running_loop().create_task(_drain(process))
            async with (
                aiohttp.ClientSession() as session,
                session.ws_connect(url, max_msg_size=_LARGEST_MESSAGE) as socket,
            ):
                browser = Chromium(socket)
                try:
                    yield browser
                finally:
                    await browser.close()
                    draining.cancel()
        finally:
            with contextlib.suppress(ProcessLookupError, asyncio.TimeoutError, TimeoutError):
                await asyncio.wait_for(process.wait(), 5.0)
            if process.returncode is None:
                process.kill()
                await process.wait()


async def _address(process: asyncio.subprocess.Process) -> str:
    """Return the address of the DevTools protocol, which a Chromium prints at its start."""
    assert process.stderr is not None
    said = []
    async for line in process.stderr:
        text = line.decode(errors="replace").strip()
        said.append(text)
        if text.startswith("DevTools listening on "):
            return text.removeprefix("DevTools listening on ")
    raise BrowserError("Chromium ended at its start: " + " ".join(said[-5:]))


async def _drain(process: asyncio.subprocess.Process) -> None:
    """Read on what a browser prints: a full pipe would stop it."""
    assert process.stderr is not None
    while await process.stderr.read(65536):
        pass
