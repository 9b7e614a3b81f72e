"""The HTTP server of the page: files, one WebSocket for each page, and the checks of both."""

import asyncio
import contextlib
import json
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

from aiohttp import WSCloseCode, WSMsgType, web

from vergence_web.access import Access
from vergence_web.rate_limit import FailureLimit, RateLimit
from vergence_web.requests import (
    LONGEST_MESSAGE,
    Answer,
    Command,
    Drawn,
    Message,
    RequestError,
    Show,
    parse,
)
from vergence_web.viewers import Viewer, Viewers

COOKIE = "vergence_token"
PAGE = Path(str(files("vergence_web"))) / "page"
_HEADERS = {
    "Content-Security-Policy": "default-src 'self'; img-src 'self' blob: data:; style-src 'self'; object-src 'none'; "
    "base-uri 'none'; form-action 'self'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-cache",
}
_TOKEN_TRIES_PER_S, _TOKEN_TRIES = 0.2, 10.0
_HEARTBEAT_S = 10.0
_DRAWN_PER_S = 200.0

Reply = Callable[[Answer], None]
Perform = Callable[[Message, Reply], None]


@dataclass
class Limits:
    """How much pages may do; may be changed at any time."""

    max_viewers: int
    requests_per_s: float


class PageServer:
    """Serves the page. `perform` is called with each valid request that is not about the page itself."""

    def __init__(self, access: Access, viewers: Viewers, limits: Limits, perform: Perform) -> None:
        self._access, self._viewers, self._limits, self._perform = access, viewers, limits, perform
        self._failures = FailureLimit(_TOKEN_TRIES_PER_S, _TOKEN_TRIES)
        self._sockets: set[web.WebSocketResponse] = set()
        self.refused = 0
        """Requests refused so far: for the token, the Host, the Origin, the rate, or as invalid."""
        self.app = web.Application(middlewares=[self._guard], client_max_size=LONGEST_MESSAGE)
        self.app.router.add_get("/", self._index)
        self.app.router.add_get("/socket", self._socket)
        self.app.router.add_static("/page", PAGE)
        self.app.on_shutdown.append(self._close_all)

    @web.middleware
    async def _guard(self, request: web.Request, handler: Any) -> web.StreamResponse:
        """Refuse a request without the token or of a foreign Host, and add the headers of every answer."""
        refusal = self._access.host_refusal(request.headers.get("Host"))
        if refusal:
            return self._refuse(403, refusal)
        if self._access.token:
            refused = self._token_refusal(request)
            if refused is not None:
                return refused
        try:
            response = await handler(request)
        except web.HTTPException as error:
            error.headers.update(_HEADERS)
            raise
        if not response.prepared:
            response.headers.update(_HEADERS)
        return response

    def _token_refusal(self, request: web.Request) -> web.Response | None:
        """Return the answer to a request without the right token, or one that moves the token into a cookie."""
        address, now_s = request.remote or "", time.monotonic()
        if not self._failures.may_try(address, now_s):
            return self._refuse(429, "too many wrong tokens: try again in a minute")
        if self._access.knows(request.cookies.get(COOKIE)):
            return None
        given = request.query.get("token")
        if given is not None and request.path == "/" and self._access.knows(given):
            # Out of the address bar and the history.
            moved = web.Response(status=303, headers={"Location": "/", **_HEADERS})
            moved.set_cookie(COOKIE, self._access.token, httponly=True, samesite="Strict", path="/")
            return moved
        if given is not None or COOKIE in request.cookies:
            self._failures.failed(address, now_s)
        return self._refuse(401, "the page needs its token: open the address that web_node printed at its start")

    def _refuse(self, status: int, text: str) -> web.Response:
        self.refused += 1
        return web.Response(status=status, text=f"{text}\n", headers=_HEADERS)

    async def _index(self, request: web.Request) -> web.FileResponse:
        return web.FileResponse(PAGE / "index.html")

    async def _socket(self, request: web.Request) -> web.StreamResponse:
        refusal = self._access.origin_refusal(request.headers.get("Origin"), request.headers.get("Host"))
        if refusal:
            return self._refuse(403, refusal)
        if len(self._viewers) >= self._limits.max_viewers:
            return self._refuse(503, f"at most {self._limits.max_viewers} pages may be open at a time (max_viewers)")
        socket = web.WebSocketResponse(heartbeat=_HEARTBEAT_S, max_msg_size=LONGEST_MESSAGE, compress=False)
        await socket.prepare(request)
        self._sockets.add(socket)
        viewer = self._viewers.open(socket.send_bytes)
        sending = asyncio.get_running_loop().create_task(_until_closed(viewer, socket))
        try:
            await self._serve(socket, viewer)
        finally:
            self._sockets.discard(socket)
            sending.cancel()
            self._viewers.close(viewer)
        return socket

    async def _serve(self, socket: web.WebSocketResponse, viewer: Viewer) -> None:
        """Receive a page's messages until it goes."""
        loop = asyncio.get_running_loop()
        rate = RateLimit(self._limits.requests_per_s, max(1.0, self._limits.requests_per_s))
        drawn_rate, complaints = RateLimit(_DRAWN_PER_S, _DRAWN_PER_S), RateLimit(1.0, 1.0)

        async def send(answer: Answer) -> None:
            if not socket.closed:
                await _quietly(socket.send_str(answer.as_json()))

        def reply(answer: Answer) -> None:
            with contextlib.suppress(RuntimeError):  # the server has ended meanwhile
                loop.call_soon_threadsafe(lambda: loop.create_task(send(answer)))

        async for received in socket:
            if received.type is not WSMsgType.TEXT:
                self.refused += 1
                await socket.close(code=WSCloseCode.UNSUPPORTED_DATA, message=b"messages must be text")
                return
            try:
                message = parse(received.data)
            except RequestError as error:
                if rate.allows(time.monotonic()):
                    self.refused += 1
                    await send(Answer(_number_of(received.data), False, str(error)))
                continue
            limit = drawn_rate if isinstance(message.request, Drawn) else rate
            rate.rate_hz = self._limits.requests_per_s
            if not limit.allows(time.monotonic()) and message.request != Command("stop"):
                self.refused += 1
                if complaints.allows(time.monotonic()):
                    allowed = f"at most {self._limits.requests_per_s:g} requests per second"
                    await send(Answer(message.number, False, f"refused: {allowed} are allowed (requests_per_s)"))
                continue
            self._on_message(message, viewer, reply)

    def _on_message(self, message: Message, viewer: Viewer, reply: Reply) -> None:
        request = message.request
        if isinstance(request, Drawn):
            viewer.on_drawn(request)
        elif isinstance(request, Show):
            viewer.shows_edges = request.edges
            self._viewers.changed()
        else:
            self._perform(message, reply)

    async def _close_all(self, app: web.Application) -> None:
        for socket in list(self._sockets):
            await _quietly(socket.close(code=WSCloseCode.GOING_AWAY, message=b"web_node ends"))


async def _until_closed(viewer: Viewer, socket: web.WebSocketResponse) -> None:
    try:
        await viewer.run()
    except (ConnectionError, RuntimeError):  # the page has gone meanwhile
        await _quietly(socket.close())


async def _quietly(sending: Any) -> None:
    try:
        await sending
    except (ConnectionError, RuntimeError):
        return


def _number_of(text: str) -> int:
    """Return a message's own number, 0 where it has none."""
    try:
        number = json.loads(text)["id"]
    except (ValueError, TypeError, KeyError, RecursionError):
        return 0
    return number if type(number) is int else 0
