"""The event loop of the page's server, in a thread of its own."""

import asyncio
import contextlib
import threading
from collections.abc import Callable

from aiohttp import web

from vergence_rig.parameters import ParameterError

_CLOSED_WITHIN_S = 2.0


class ServerThread:
    """Serves an application until it is closed. Raises ParameterError where the address cannot be listened on."""

    def __init__(self, app: web.Application, address: str, port: int) -> None:
        self._loop = asyncio.new_event_loop()
        self._runner = web.AppRunner(app, access_log=None, shutdown_timeout=_CLOSED_WITHIN_S)
        try:
            self.port = self._loop.run_until_complete(self._listen(address, port))
        except OSError as error:
            self._loop.run_until_complete(self._runner.cleanup())
            self._loop.close()
            free = f"one at {address!r} that this user may listen on and no other program does"
            raise ParameterError("port", port, f"{free} ({error.strerror or error})") from error
        self._thread = threading.Thread(target=self._loop.run_forever, name="page", daemon=True)
        self._thread.start()

    async def _listen(self, address: str, port: int) -> int:
        await self._runner.setup()
        await web.TCPSite(self._runner, address, port).start()
        return int(self._runner.addresses[0][1])

    def run_soon(self, call: Callable[[], None]) -> None:
        """Have the server's thread run this."""
        with contextlib.suppress(RuntimeError):  # the loop has been closed
            self._loop.call_soon_threadsafe(call)

    def close(self) -> None:
        """Close every connection, and end the thread."""
        if self._loop.is_closed():
            return
        asyncio.run_coroutine_threadsafe(self._runner.cleanup(), self._loop).result(2 * _CLOSED_WITHIN_S)
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(_CLOSED_WITHIN_S)
        self._loop.close()
