"""The open pages: each gets the newest when it has drawn the last, so that a slow one never has a queue."""

import asyncio
import math
from collections.abc import Awaitable, Callable, Mapping
from statistics import median

from vergence_web.requests import Drawn
from vergence_web.update import Board, Part, encode

_UNDRAWN = 2
"""Updates on their way to a page: one is drawn while the next one travels."""
_LATENCIES = 128

Send = Callable[[bytes], Awaitable[None]]


class Viewer:
    """One open page."""

    def __init__(self, board: Board, send: Send) -> None:
        self._board, self._send = board, send
        self._version = self._sent = self._drawn = 0
        self._changed = asyncio.Event()
        self.shows_edges = False
        self.latencies_s: list[float] = []

    @property
    def ready(self) -> bool:
        """True if the page has drawn enough of what was sent to be sent more."""
        return self._sent - self._drawn < _UNDRAWN

    def wake(self) -> None:
        """Look for newer parts."""
        self._changed.set()

    def on_drawn(self, drawn: Drawn) -> None:
        """Note that the page has drawn an update."""
        if self._drawn < drawn.number <= self._sent:
            self._drawn = drawn.number
            self.wake()
            if math.isfinite(drawn.latency_s):
                self.latencies_s = [*self.latencies_s[1 - _LATENCIES :], drawn.latency_s]

    async def run(self) -> None:
        """Send the newest whenever there is something newer and the page is ready; ends by cancellation."""
        while True:
            await self._changed.wait()
            self._changed.clear()
            if not self.ready:
                continue
            version, parts = self._board.newer_than(self._version)
            if not self.shows_edges:
                parts.pop("edges", None)
            if parts:
                self._version, self._sent = version, self._sent + 1
                await self._send(encode(self._sent, parts))


class Viewers:
    """All open pages. Everything runs in the thread of the server's loop, except the reading of `ready`."""

    def __init__(self, on_count: Callable[[int, bool], None]) -> None:
        """Call `on_count` with the number of pages, and whether any shows the edges, whenever one of them changes."""
        self._board = Board()
        self._viewers: list[Viewer] = []
        self._on_count = on_count

    def __len__(self) -> int:
        return len(self._viewers)

    @property
    def ready(self) -> bool:
        """True if any page can be sent something; where none can, nothing needs to be made."""
        return any(viewer.ready for viewer in self._viewers)

    def open(self, send: Send) -> Viewer:
        """Return a new page's viewer, which sends by `send`."""
        viewer = Viewer(self._board, send)
        self._viewers.append(viewer)
        self.changed()
        viewer.wake()
        return viewer

    def close(self, viewer: Viewer) -> None:
        """Forget a page that has gone."""
        self._viewers.remove(viewer)
        if not self._viewers:
            self._board.clear()
        self.changed()

    def changed(self) -> None:
        """Report the number of pages, and what they show."""
        self._on_count(len(self._viewers), any(viewer.shows_edges for viewer in self._viewers))

    def post(self, parts: Mapping[str, Part]) -> None:
        """Give every page newer parts."""
        if self._viewers:
            self._board.post(parts)
        for viewer in self._viewers:
            viewer.wake()

    def latency_s(self) -> float:
        """Return the median time from an image's stamp to the screen, as the pages report it [s]; NaN if unknown."""
        latencies = [latency for viewer in self._viewers for latency in viewer.latencies_s]
        return median(latencies) if latencies else math.nan
