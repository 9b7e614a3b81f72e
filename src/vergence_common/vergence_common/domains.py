"""A DDS domain that no other run on this machine uses, so that simultaneous runs stay isolated."""

import fcntl
import os
import random
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

# DDS derives UDP ports from the domain; above 101 they collide with the ephemeral ports of Linux.
_DOMAINS = range(1, 102)


class NoDomainError(RuntimeError):
    """Every domain is reserved."""


@contextmanager
def own_domain(lock_dir: Path | None = None) -> Iterator[int]:
    """Reserve a domain for the block: a ROS_DOMAIN_ID that no other block on this machine has at the same time.

    A lock on a file per domain holds it, so that it is free again however the process ends. Raises NoDomainError where
    all are reserved.
    """
    folder = lock_dir or Path(tempfile.gettempdir()) / "vergence_domains"
    folder.mkdir(mode=0o777, parents=True, exist_ok=True)
    for domain in random.sample(_DOMAINS, len(_DOMAINS)):
        try:
            handle = os.open(folder / str(domain), os.O_CREAT | os.O_RDWR | os.O_CLOEXEC, 0o666)
        except PermissionError:
            continue  # another user's
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(handle)
            continue
        try:
            yield domain
        finally:
            os.close(handle)
        return
    raise NoDomainError(f"all {len(_DOMAINS)} DDS domains are reserved: see {folder}")
