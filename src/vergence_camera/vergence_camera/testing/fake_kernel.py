"""A kernel with webcams in it, at the layer of the ioctls: what the tests use instead of hardware."""

import errno
import itertools
import os
from collections.abc import Mapping
from ctypes import Structure

from vergence_camera.testing.fake_camera import FakeCamera
from vergence_camera.testing.fake_driver import ANSWERS, fail_with


class FakeKernel:
    """See Kernel. `cameras` maps device paths to cameras and may be changed at any time."""

    def __init__(self, cameras: Mapping[str, FakeCamera]) -> None:
        self.cameras = dict(cameras)
        self._open: dict[int, FakeCamera] = {}
        self._descriptors = itertools.count(1000)

    @property
    def open_descriptors(self) -> list[int]:
        """Descriptors that are open."""
        return sorted(self._open)

    def open(self, path: str) -> int:
        """See Kernel."""
        camera = self.cameras.get(path)
        if camera is None or not camera.plugged:
            raise OSError(errno.ENOENT, os.strerror(errno.ENOENT))
        fail_with(camera.open_errno)
        descriptor = next(self._descriptors)
        self._open[descriptor] = camera
        return descriptor

    def close(self, descriptor: int) -> None:
        """See Kernel."""
        camera = self._open.pop(descriptor)
        if camera.streamer == descriptor:
            camera.streamer = 0

    def ioctl(self, descriptor: int, request: int, argument: Structure) -> None:
        """See Kernel."""
        camera = self._camera(descriptor)
        camera.requests.append(request)
        answer = ANSWERS.get(request)
        if answer is None:
            raise OSError(errno.ENOTTY, os.strerror(errno.ENOTTY))
        with camera.changed:
            answer(camera, descriptor, argument)

    def map(self, descriptor: int, length: int, offset: int) -> "_FakeBuffer":
        """See Kernel."""
        return _FakeBuffer(self._camera(descriptor).memory[offset >> 12], length)

    def wait(self, descriptor: int, timeout_s: float) -> bool:
        """See Kernel."""
        camera = self._open[descriptor]
        with camera.changed:
            ready = camera.changed.wait_for(lambda: camera.filled or not camera.plugged, timeout_s)
        return bool(ready)

    def _camera(self, descriptor: int) -> FakeCamera:
        camera = self._open.get(descriptor)
        if camera is None:
            raise OSError(errno.EBADF, os.strerror(errno.EBADF))
        fail_with(0 if camera.plugged else errno.ENODEV)
        return camera


class _FakeBuffer:
    def __init__(self, memory: bytearray, length: int) -> None:
        self._memory: bytearray | None = memory
        self._length = length

    def __getitem__(self, part: slice) -> bytes:
        if self._memory is None:
            raise ValueError("read from an unmapped buffer")
        return bytes(self._memory[: self._length][part])

    def close(self) -> None:
        self._memory = None
