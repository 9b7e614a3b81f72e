"""The pictures in a multipart/x-mixed-replace stream, as IP cameras send it, from bytes in any slices."""

import re
from dataclasses import dataclass

from vergence_camera.errors import CorruptFrameError, UnsupportedError
from vergence_camera.jpeg import inspect_jpeg

_LONGEST_PART = 32 * 1024 * 1024
_LENGTH = re.compile(rb"^content-length\s*:\s*(\d{1,12})\s*$", re.IGNORECASE | re.MULTILINE)


@dataclass(frozen=True)
class Part:
    """One part's body, and when its first byte came (nanoseconds, monotonic)."""

    data: bytes
    time_ns: int


def boundary_of(content_type: str) -> bytes:
    """Return the boundary line's beginning; raise UnsupportedError for another type of content."""
    kind, _, parameters = content_type.partition(";")
    if not kind.strip().lower().startswith("multipart/"):
        raise UnsupportedError(f"the server sends {kind.strip() or 'no content type'}, not multipart/x-mixed-replace")
    found = re.search(r'boundary\s*=\s*"?([^";]+)"?', parameters, re.IGNORECASE)
    if found is None:
        raise UnsupportedError("the server names no boundary between its pictures")
    # Some cameras put the dashes of the delimiter into the boundary itself.
    return b"--" + found.group(1).strip().lstrip("-").encode("latin-1")


class MultipartParser:
    """Finds the parts in a stream of bytes. A damaged part is lost; parsing resumes at the next boundary line."""

    def __init__(self, boundary: bytes) -> None:
        self._boundary = boundary
        self._pending = bytearray()
        self._part_time_ns = 0
        self._body_begin: int | None = None
        self._length: int | None = None

    def feed(self, data: bytes, now_ns: int) -> list[Part]:
        """Return the parts that are now complete, oldest first; raise CorruptFrameError if no boundary comes."""
        self._pending += data
        parts = []
        while True:
            if self._body_begin is None and not self._find_body(now_ns):
                break
            time_ns = self._part_time_ns
            body = self._read_body()
            if body is None:
                break
            parts.append(Part(body, time_ns))
        if len(self._pending) > _LONGEST_PART:
            self._pending.clear()
            self._body_begin = None
            raise CorruptFrameError(f"no boundary {self._boundary!r} within {_LONGEST_PART} bytes")
        return parts

    def _find_body(self, now_ns: int) -> bool:
        """Go to the next part's body; False if its header is not complete yet."""
        begin = self._pending.find(self._boundary)
        if begin < 0:
            del self._pending[: max(0, len(self._pending) - len(self._boundary))]
            return False
        if begin > 0:
            del self._pending[:begin]
        if self._part_time_ns == 0:
            self._part_time_ns = now_ns
        blank = re.search(rb"\r?\n\r?\n", self._pending)
        if blank is None:
            return False
        stated = _LENGTH.search(bytes(self._pending[: blank.start()]).replace(b"\r\n", b"\n"))
        self._length = int(stated.group(1)) if stated else None
        self._body_begin = blank.end()
        return True

    def _read_body(self) -> bytes | None:
        assert self._body_begin is not None
        begin = self._body_begin
        if self._length is not None and self._length <= _LONGEST_PART:
            if len(self._pending) < begin + self._length:
                return None if self._pending.find(self._boundary, begin) < 0 else self._up_to_boundary(begin)
            body = bytes(self._pending[begin : begin + self._length])
            self._next_part(begin + self._length)
            return body
        return self._up_to_boundary(begin)

    def _up_to_boundary(self, begin: int) -> bytes | None:
        end = self._pending.find(self._boundary, begin)
        if end < 0:
            return self._whole_picture(begin)
        body = bytes(self._pending[begin:end])
        self._next_part(end)
        return body.removesuffix(b"\r\n").removesuffix(b"\n") if body.endswith(b"\n") else body

    def _whole_picture(self, begin: int) -> bytes | None:
        """Return a picture that is visibly complete, rather than waiting a frame's time for the next boundary."""
        tail = bytes(self._pending[-4:]).rstrip(b"\r\n")
        if not tail.endswith(b"\xff\xd9"):
            return None
        body = bytes(self._pending[begin:]).rstrip(b"\r\n")
        try:
            inspect_jpeg(body)
        except CorruptFrameError:
            return None
        self._next_part(len(self._pending))
        return body

    def _next_part(self, position: int) -> None:
        del self._pending[:position]
        self._body_begin, self._length, self._part_time_ns = None, None, 0
