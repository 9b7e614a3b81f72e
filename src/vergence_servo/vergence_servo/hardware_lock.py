"""One owner for each servo channel of this machine: locks that end with the process that holds them."""

import fcntl
import os
import re
import stat
from collections.abc import Iterable
from pathlib import Path

from vergence_servo.drivers.protocol import DriverUnavailableError

_SHARED = 0o1777
_LONGEST_NAME = 200


def lock_folder() -> Path:
    """Return the folder of the lock files: the same for all users of the machine, whatever HOME is."""
    folder = Path("/run/lock")
    try:
        shared = stat.S_IMODE(folder.stat().st_mode) == _SHARED
    except OSError:
        shared = False
    return folder if shared else Path("/tmp")


class HardwareLocks:
    """Locks of pieces of hardware, held until `close` or until this process and those that inherit them have ended."""

    def __init__(self, hardware: Iterable[str]) -> None:
        """Take a lock for each piece. Raises DriverUnavailableError, with the owner's pid, where one has an owner."""
        self._held: dict[int, Path] = {}
        try:
            for name in hardware:
                path = lock_folder() / ("vergence_" + re.sub(r"[^A-Za-z0-9]+", "_", name)[-_LONGEST_NAME:] + ".lock")
                self._held[_lock(name, path)] = path
        except BaseException:
            self.close()
            raise

    @property
    def descriptors(self) -> tuple[int, ...]:
        """The open files: a process that inherits them holds the locks too."""
        return tuple(self._held)

    def close(self) -> None:
        """Let go of all locks. Closing twice does nothing."""
        for descriptor, path in self._held.items():
            path.unlink(missing_ok=True)
            os.close(descriptor)
        self._held.clear()


def _lock(name: str, path: Path) -> int:
    while True:
        try:
            descriptor = _opened(path)
        except OSError as error:
            raise DriverUnavailableError(f"{name}: lock file {path} cannot be opened: {error.strerror}") from error
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            owner = os.read(descriptor, 20).decode(errors="replace").strip() or "unknown"
            os.close(descriptor)
            raise DriverUnavailableError(
                f"{name} must have one owner: the process {owner} (pid) drives it; end that one first"
            ) from None
        if _is_file(descriptor, path):
            os.ftruncate(descriptor, 0)
            os.write(descriptor, b"%d\n" % os.getpid())
            return descriptor
        os.close(descriptor)  # its owner has just ended and removed it


def _opened(path: Path) -> int:
    # Without O_CREAT first: the kernel refuses it in a shared folder for a file of another user (protected_regular).
    try:
        return os.open(path, os.O_RDWR | os.O_NOFOLLOW)
    except FileNotFoundError:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o666)
    if os.fstat(descriptor).st_uid == os.geteuid():
        os.fchmod(descriptor, 0o666)  # whatever the umask is: any user's process must be able to ask
    return descriptor


def _is_file(descriptor: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(descriptor), path.stat())
    except FileNotFoundError:
        return False
