"""The one way to open a file that a user names: `~` is expanded; kind and size are checked before anything is read."""

import os
import stat
from pathlib import Path

LARGEST_BYTES = 256_000_000
"""Largest file that is read whole [bytes]."""

_KINDS = (
    (stat.S_ISDIR, "Is a directory"),
    (stat.S_ISFIFO, "Is a pipe"),
    (stat.S_ISSOCK, "Is a socket"),
    (stat.S_ISCHR, "Is a device"),
    (stat.S_ISBLK, "Is a device"),
)


class FileError(ValueError):
    """A file that cannot be used: the message says why, as the end of a sentence that begins with the file's name."""


def expanded(path: str | Path) -> Path:
    """Return a path with `~` and `~user` replaced by the home folder; where there is none, `~` stays."""
    try:
        return Path(path).expanduser()
    except RuntimeError:  # no such user, or no HOME
        return Path(path)


def check_regular_file(path: str | Path, largest_bytes: float = float("inf")) -> Path:
    """Return the expanded path of a regular file of at most `largest_bytes`. Raises FileError; opens nothing."""
    found = expanded(path)
    try:
        _check(found.stat(), largest_bytes)
    except (OSError, ValueError) as error:
        raise _unreadable(error) from error
    return found


def read_regular_file(path: str | Path, largest_bytes: int = LARGEST_BYTES) -> bytes:
    """Return the bytes of a regular file of at most `largest_bytes`.

    Raises FileError; never waits for a pipe, and never reads more than the limit.
    """
    found = check_regular_file(path, largest_bytes)
    try:
        descriptor = os.open(found, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        with os.fdopen(descriptor, "rb") as file:
            _check(os.fstat(descriptor), largest_bytes)
            data = file.read(largest_bytes + 1)
    except OSError as error:
        raise _unreadable(error) from error
    if len(data) > largest_bytes:  # a file of /proc has no size
        raise FileError(_too_large(largest_bytes, "more"))
    return data


def _check(found: os.stat_result, largest_bytes: float) -> None:
    kind = next((name for is_kind, name in _KINDS if is_kind(found.st_mode)), "")
    if kind:
        raise FileError(f"cannot be read: {kind} (it must be a regular file)")
    if found.st_size > largest_bytes:
        raise FileError(_too_large(largest_bytes, str(found.st_size)))


def _too_large(largest_bytes: float, size: str) -> str:
    return f"cannot be read: it must have at most {largest_bytes:.0f} bytes: got {size}"


def _unreadable(error: Exception) -> FileError:
    return error if isinstance(error, FileError) else FileError(f"cannot be read: {_reason(error)}")


def _reason(error: Exception) -> str:
    return getattr(error, "strerror", None) or str(error)
