"""The few system calls that V4L2 needs, behind a protocol whose fake is in testing/fake_kernel.py."""

import fcntl
import mmap
import os
import select
from ctypes import Structure
from typing import Protocol


class MappedBuffer(Protocol):
    """One capture buffer in memory shared with the driver."""

    def __getitem__(self, part: slice) -> bytes:
        """Return a copy of part of it."""
        ...

    def close(self) -> None:
        """Unmap it."""
        ...


class Kernel(Protocol):
    """System calls on a capture device. Every method raises OSError with the kernel's errno."""

    def open(self, path: str) -> int:
        """Open a device for reading and writing, never blocking; return its descriptor."""
        ...

    def close(self, descriptor: int) -> None:
        """Close a descriptor."""
        ...

    def ioctl(self, descriptor: int, request: int, argument: Structure) -> None:
        """Do one request; the driver reads and writes `argument`."""
        ...

    def map(self, descriptor: int, length: int, offset: int) -> MappedBuffer:
        """Map one capture buffer."""
        ...

    def wait(self, descriptor: int, timeout_s: float) -> bool:
        """Wait until a buffer, or an error, is ready; False if the time passed."""
        ...


class LinuxKernel:
    """The real one."""

    def open(self, path: str) -> int:
        """See Kernel."""
        return os.open(path, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)

    def close(self, descriptor: int) -> None:
        """See Kernel."""
        os.close(descriptor)

    def ioctl(self, descriptor: int, request: int, argument: Structure) -> None:
        """See Kernel."""
        while True:
            try:
                fcntl.ioctl(descriptor, request, argument, True)
                return
            except InterruptedError:
                continue

    def map(self, descriptor: int, length: int, offset: int) -> mmap.mmap:
        """See Kernel."""
        return mmap.mmap(descriptor, length, mmap.MAP_SHARED, mmap.PROT_READ | mmap.PROT_WRITE, offset=offset)

    def wait(self, descriptor: int, timeout_s: float) -> bool:
        """See Kernel."""
        poll = select.poll()
        poll.register(descriptor, select.POLLIN)
        return bool(poll.poll(max(0.0, timeout_s) * 1000.0))
