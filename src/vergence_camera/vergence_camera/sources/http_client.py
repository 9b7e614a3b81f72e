"""A GET that can be read in slices of time: what the standard library's client cannot do once it has timed out."""

import base64
import contextlib
import re
import select
import socket
import ssl
import time
from urllib.parse import unquote, urljoin, urlsplit

from vergence_camera.errors import DisconnectedError, PermissionDeniedError, UnsupportedError

_REDIRECTS = {301, 302, 303, 307, 308}
_LONGEST_HEADER = 64 * 1024


class HttpStream:
    """The body of one GET request.

    Redirects (five at most), basic authentication (`http://user:password@host`), https and chunked bodies are
    understood. `headers` has lower-case names.
    """

    def __init__(self, url: str, timeout_s: float) -> None:
        self._timeout_s = timeout_s
        self._socket: socket.socket | None = None
        self._body = bytearray()
        self._broken: DisconnectedError | None = None
        self.headers: dict[str, str] = {}
        self._chunks: _Dechunker | None = None
        for _ in range(6):
            status = self._request(url)
            if status not in _REDIRECTS:
                break
            url = urljoin(url, self.headers.get("location", url))
            self.close()
        if status != 200:
            self.close()
            reason = f"{shown_url(url)}: the server answers {status}"
            if status in (401, 403):
                raise PermissionDeniedError(
                    f"{reason}: it requires a user and password (http://user:password@host/...)"
                )
            raise DisconnectedError(reason)

    def read(self, timeout_s: float) -> bytes | None:
        """Return what has come, or None if nothing came in time.

        Raises:
            DisconnectedError: the server has ended the stream, or the connection broke; again at every further call.
        """
        if self._broken is not None:
            raise DisconnectedError(str(self._broken))
        try:
            return self._read(timeout_s)
        except DisconnectedError as error:
            self._broken = error
            raise

    def _read(self, timeout_s: float) -> bytes | None:
        if self._body:
            data, self._body = bytes(self._body), bytearray()
            return self._dechunked(data)
        if self._socket is None:
            raise DisconnectedError("the stream is closed")
        if self._chunks is not None and self._chunks.ended:
            raise DisconnectedError("the server ended the stream")
        pending = isinstance(self._socket, ssl.SSLSocket) and self._socket.pending()
        if not pending and not select.select([self._socket], [], [], max(0.0, timeout_s))[0]:
            return None
        try:
            data = self._socket.recv(65536)
        except (ssl.SSLWantReadError, TimeoutError):
            return None
        except OSError as error:
            raise DisconnectedError(f"the connection broke: {error.strerror or error}") from error
        if not data:
            raise DisconnectedError("the server closed the stream")
        return self._dechunked(data)

    def close(self) -> None:
        """Hang up; harmless twice."""
        connection, self._socket = self._socket, None
        if connection is not None:
            with contextlib.suppress(OSError):
                connection.shutdown(socket.SHUT_RDWR)
            connection.close()

    def _dechunked(self, data: bytes) -> bytes:
        if self._chunks is None:
            return data
        return self._chunks.feed(data)

    def _request(self, url: str) -> int:
        parts = urlsplit(url)
        if parts.scheme not in ("http", "https") or not parts.hostname:
            raise UnsupportedError(f"{shown_url(url)}: is no http or https address")
        secure = parts.scheme == "https"
        address = (parts.hostname, parts.port or (443 if secure else 80))
        target = (parts.path or "/") + (f"?{parts.query}" if parts.query else "")
        lines = [f"GET {target} HTTP/1.0", f"Host: {parts.netloc.rpartition('@')[2]}", "User-Agent: vergence_camera"]
        if parts.username is not None:
            secret = f"{unquote(parts.username)}:{unquote(parts.password or '')}"
            lines.append(f"Authorization: Basic {base64.b64encode(secret.encode()).decode()}")
        try:
            self._socket = socket.create_connection(address, self._timeout_s)
            if secure:
                self._socket = ssl.create_default_context().wrap_socket(self._socket, server_hostname=parts.hostname)
            self._socket.sendall(("\r\n".join(lines) + "\r\n\r\n").encode())
            return self._read_head(url)
        except OSError as error:
            self.close()
            if isinstance(error, DisconnectedError):
                raise
            raise DisconnectedError(f"{shown_url(url)}: cannot be reached: {error.strerror or error}") from error

    def _read_head(self, url: str) -> int:
        assert self._socket is not None
        received = bytearray()
        deadline = time.monotonic() + self._timeout_s
        while (end := received.find(b"\r\n\r\n")) < 0:
            self._socket.settimeout(max(0.001, deadline - time.monotonic()))
            data = self._socket.recv(4096)
            received += data
            if not data or len(received) > _LONGEST_HEADER:
                raise DisconnectedError(f"{shown_url(url)}: the server sends no HTTP header")
        self._body = received[end + 4 :]
        status_line, *lines = received[:end].decode("latin-1").split("\r\n")
        pairs = (line.partition(":") for line in lines)
        self.headers = {name.strip().lower(): value.strip() for name, _, value in pairs}
        self._chunks = _Dechunker() if "chunked" in self.headers.get("transfer-encoding", "").lower() else None
        words = status_line.split()
        if len(words) < 2 or not words[0].startswith("HTTP/") or not words[1].isdigit():
            raise DisconnectedError(f"{shown_url(url)}: the server does not speak HTTP")
        return int(words[1])


class _Dechunker:
    """Takes the lengths out of a chunked body (RFC 9112, section 7.1)."""

    def __init__(self) -> None:
        self._pending = bytearray()
        self._left = 0
        self.ended = False

    def feed(self, data: bytes) -> bytes:
        self._pending += data
        body = bytearray()
        while self._pending:
            if self._left > 0:
                part = self._pending[: self._left]
                body += part
                del self._pending[: len(part)]
                self._left -= len(part)
                continue
            line_end = self._pending.find(b"\r\n")
            if line_end < 0:
                break
            line = bytes(self._pending[:line_end]).partition(b";")[0].strip()
            del self._pending[: line_end + 2]
            if not line:  # the line end behind a chunk
                continue
            try:
                self._left = int(line, 16)
            except ValueError as error:
                raise DisconnectedError(f"the server's chunk length is {line[:20]!r}") from error
            if self._left == 0:
                self.ended = True
                break
        return bytes(body)


_SECRET = re.compile(
    r"([?&;][^=&;]*(?:pw|pass|user|usr|auth|token|key|secret|login|account)[^=&;]*=)[^&;]*", re.IGNORECASE
)


def shown_url(url: str) -> str:
    """Return the address without its user and password, also where the query has them, as many cameras want it."""
    scheme, _, rest = url.partition("://")
    host, slash, path = rest.partition("/")
    shown = _SECRET.sub(r"\1...", path)
    return f"{scheme}://{host.rpartition('@')[2]}{slash}{shown}"
