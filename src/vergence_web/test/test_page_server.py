"""The HTTP server: what it serves, and whom it refuses."""

import asyncio
import json
import re
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from typing import Any

import pytest
from aiohttp import ClientSession, ClientWebSocketResponse, WSMsgType, WSServerHandshakeError
from aiohttp.test_utils import TestServer

from vergence_rig.parameters import ParameterError
from vergence_web.access import Access
from vergence_web.requests import LONGEST_MESSAGE, Answer, Command, Message
from vergence_web.server import COOKIE, PAGE, Limits, PageServer, Reply
from vergence_web.server_thread import ServerThread
from vergence_web.update import Part
from vergence_web.viewers import Viewers

TOKEN = "a-token-of-this-test"


class Served:
    """A server, what it was asked to perform, and a client without cookies of its own."""

    def __init__(self, token: str, limits: Limits) -> None:
        self.viewers = Viewers(lambda count, edges: None)
        self.performed: list[Message] = []
        self.page = PageServer(Access(token, "127.0.0.1"), self.viewers, limits, self._perform)
        self.server = TestServer(self.page.app)
        self.session = ClientSession()

    def _perform(self, message: Message, reply: Reply) -> None:
        self.performed.append(message)
        reply(Answer(message.number, True, "done"))

    @property
    def origin(self) -> str:
        return f"http://127.0.0.1:{self.server.port}"

    async def get(self, path: str, **options: Any) -> tuple[int, str, Any]:
        async with self.session.get(self.origin + path, allow_redirects=False, **options) as response:
            return response.status, await response.text(), response.headers

    @asynccontextmanager
    async def socket(self, **headers: str) -> AsyncIterator[ClientWebSocketResponse]:
        given = {"Origin": self.origin, **headers}
        async with self.session.ws_connect(f"{self.origin}/socket", headers=given) as socket:
            yield socket

    async def refused(self, **headers: str) -> int:
        """Return the status with which a socket is refused."""
        with pytest.raises(WSServerHandshakeError) as error:
            async with self.socket(**headers):
                pass
        return error.value.status


def served(
    test: Callable[[Served], Awaitable[None]], token: str = "", max_viewers: int = 8, requests_per_s: float = 20.0
) -> None:
    """Run a test beside a server."""

    async def run() -> None:
        one = Served(token, Limits(max_viewers, requests_per_s))
        await one.server.start_server()
        try:
            await test(one)
        finally:
            await one.session.close()
            await one.server.close()

    asyncio.run(run())


async def answer(socket: ClientWebSocketResponse) -> dict[str, Any]:
    """Return the next answer, past updates."""
    while True:
        received = await socket.receive(10.0)
        if received.type is not WSMsgType.BINARY:
            assert received.type is WSMsgType.TEXT, received
            values: dict[str, Any] = json.loads(received.data)
            return values


def test_the_page_and_all_that_it_names_are_served() -> None:
    async def test(one: Served) -> None:
        status, text, headers = await one.get("/")
        assert status == 200
        assert "default-src 'self'" in headers["Content-Security-Policy"]
        assert headers["X-Content-Type-Options"] == "nosniff"
        for path in re.findall(r'(?:href|src)="([^"]+)"', text):
            assert (await one.get(path))[0] == 200, path
        for module in (PAGE / "modules").iterdir():
            for name in re.findall(r'from "\./([^"]+)"', module.read_text(encoding="utf-8")):
                assert (PAGE / "modules" / name).is_file(), (module, name)
            assert (await one.get(f"/page/modules/{module.name}"))[0] == 200

    served(test)


def test_nothing_of_the_page_comes_from_another_host() -> None:
    for file in PAGE.rglob("*.*"):
        urls = re.findall(r"""(?:https?:)?//[a-z][^\s"']*""", file.read_text(encoding="utf-8"))
        assert [url for url in urls if "www.w3.org/2000/svg" not in url] == [], file


@pytest.mark.parametrize("path", ["/page/../server.py", "/page/%2e%2e/server.py", "/page/", "/absent", "/socket"])
def test_nothing_else_is_served(path: str) -> None:
    async def test(one: Served) -> None:
        assert (await one.get(path))[0] in (403, 404, 400)

    served(test)


def test_a_foreign_host_or_origin_is_refused() -> None:
    async def test(one: Served) -> None:
        assert (await one.get("/", headers={"Host": "evil.example"}))[0] == 403
        assert await one.refused(Origin="http://evil.example") == 403
        assert await one.refused(Origin="") == 403
        assert await one.refused(Origin="http://evil.example", Host="evil.example") == 403
        assert one.page.refused == 4
        async with one.socket() as socket:
            await socket.send_str(json.dumps({"do": "hold", "id": 3}))
            assert await answer(socket) == {"answer": 3, "ok": True, "text": "done", "last": True}
        assert one.performed == [Message(3, Command("hold"))]

    served(test)


def test_a_token_is_needed_and_moves_into_a_cookie() -> None:
    async def test(one: Served) -> None:
        for path in ("/", "/page/parts.css", "/socket", "/?token=", "/?token=wrong"):
            assert (await one.get(path))[0] == 401, path
        assert await one.refused() == 401
        status, _, headers = await one.get(f"/?token={TOKEN}")
        assert (status, headers["Location"]) == (303, "/")
        assert "HttpOnly" in headers["Set-Cookie"]
        assert "SameSite=Strict" in headers["Set-Cookie"]
        cookie = {"Cookie": f"{COOKIE}={TOKEN}"}
        assert (await one.get("/", headers=cookie))[0] == 200
        async with one.socket(**cookie) as socket:
            await socket.send_str(json.dumps({"do": "hold", "id": 1}))
            assert (await answer(socket))["ok"]
        assert await one.refused(**cookie, Origin="http://evil.example") == 403

    served(test, token=TOKEN)


def test_a_token_is_not_found_by_trying() -> None:
    async def test(one: Served) -> None:
        statuses = [(await one.get(f"/?token=wrong{number}"))[0] for number in range(15)]
        assert statuses[0] == 401
        assert statuses[-1] == 429
        assert (await one.get(f"/?token={TOKEN}"))[0] == 429

    served(test, token=TOKEN)


def test_no_more_pages_than_allowed() -> None:
    async def test(one: Served) -> None:
        async with one.socket(), one.socket():
            assert await one.refused() == 503
            assert len(one.viewers) == 2

    served(test, max_viewers=2)


def test_a_wrong_message_is_answered_in_words() -> None:
    async def test(one: Served) -> None:
        async with one.socket() as socket:
            await socket.send_str('{"do": "fly", "id": 5}')
            said = await answer(socket)
            assert (said["answer"], said["ok"]) == (5, False)
            assert "do must be one of" in said["text"]
            await socket.send_str("nonsense")
            assert (await answer(socket))["answer"] == 0
        assert one.performed == []

    served(test)


def test_a_page_that_asks_too_often_is_refused_but_may_stop() -> None:
    async def test(one: Served) -> None:
        async with one.socket() as socket:
            for number in range(50):
                await socket.send_str(json.dumps({"do": "hold", "id": number}))
            await socket.send_str(json.dumps({"do": "stop", "id": 99}))
            answers: list[dict[str, Any]] = []
            while not answers or answers[-1]["answer"] != 99:
                answers.append(await answer(socket))
        refused = [said for said in answers if not said["ok"]]
        assert len(refused) == 1  # one complaint, not one for each
        assert "at most 2 requests per second" in refused[0]["text"]
        assert Message(99, Command("stop")) in one.performed
        assert len(one.performed) < 20

    served(test, requests_per_s=2.0)


@pytest.mark.parametrize("data", [b"bytes", "x" * (LONGEST_MESSAGE + 1)])
def test_bytes_and_long_messages_end_the_connection(data: bytes | str) -> None:
    async def test(one: Served) -> None:
        async with one.socket() as socket:
            await (socket.send_bytes(data) if isinstance(data, bytes) else socket.send_str(data))
            received = await socket.receive(10.0)
            assert received.type in (WSMsgType.CLOSE, WSMsgType.CLOSED)

    served(test)


def test_a_page_that_goes_is_forgotten() -> None:
    async def test(one: Served) -> None:
        async with one.socket() as socket:
            one.viewers.post({"state": Part("{}")})
            assert (await socket.receive(10.0)).type is WSMsgType.BINARY
        while len(one.viewers):
            await asyncio.sleep(0)

    served(test)


def test_a_port_in_use_is_refused_in_words() -> None:
    def page() -> PageServer:
        viewers = Viewers(lambda count, edges: None)
        return PageServer(Access("", "127.0.0.1"), viewers, Limits(8, 20.0), lambda message, reply: None)

    first = ServerThread(page().app, "127.0.0.1", 0)
    try:
        with pytest.raises(ParameterError, match=r"parameter 'port' must be one at '127\.0\.0\.1' that"):
            ServerThread(page().app, "127.0.0.1", first.port)
    finally:
        first.close()


def test_a_server_in_its_thread_ends_with_its_pages() -> None:
    viewers = Viewers(lambda count, edges: None)
    page = PageServer(Access("", "127.0.0.1"), viewers, Limits(8, 20.0), lambda message, reply: None)
    thread = ServerThread(page.app, "127.0.0.1", 0)

    async def visit() -> Any:
        origin = f"http://127.0.0.1:{thread.port}"
        async with (
            ClientSession() as session,
            session.ws_connect(f"{origin}/socket", headers={"Origin": origin}) as socket,
        ):
            await asyncio.to_thread(thread.close)
            return await socket.receive(10.0)

    assert asyncio.run(visit()).type in (WSMsgType.CLOSE, WSMsgType.CLOSED, WSMsgType.CLOSING)
    thread.close()
