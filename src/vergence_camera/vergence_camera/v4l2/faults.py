"""From the kernel's errno to an error that says how to solve it."""

import errno
import grp
import os
from pathlib import Path

from vergence_camera.errors import (
    CameraError,
    CameraNotFoundError,
    DeviceBusyError,
    PermissionDeniedError,
    UnpluggedError,
    UnsupportedError,
    UsbBandwidthError,
)

_GONE = {errno.ENODEV, errno.ENXIO, errno.EIO, errno.EPIPE, errno.ESHUTDOWN, errno.EPROTO, errno.EBADF}


def camera_error(error: OSError, doing: str, path: str) -> CameraError:
    """Return the CameraError for what the kernel answered while `doing` something with the device at `path`."""
    reason = f"{path}: {doing}: {os.strerror(error.errno) if error.errno else error}"
    if error.errno == errno.ENOENT:
        return CameraNotFoundError(f"{reason}: it is not plugged in")
    if error.errno in (errno.EACCES, errno.EPERM):
        return PermissionDeniedError(f"{reason}: {_who_may(path)}")
    if error.errno == errno.EBUSY:
        return DeviceBusyError(f"{reason}: {_who_holds(path)}")
    if error.errno == errno.ENOSPC:
        return UsbBandwidthError(
            f"{reason}: this is USB bandwidth, not the disk. Plug the two cameras into ports of different USB "
            "controllers (list_cameras shows them), or choose MJPG, a smaller size or a lower rate"
        )
    if error.errno in _GONE:
        return UnpluggedError(f"{reason}: it was unplugged or its USB link failed")
    if error.errno in (errno.ENOTTY, errno.EINVAL):
        return UnsupportedError(f"{reason}: the device is not one that can do this")
    return CameraError(error.errno, reason)


def _who_may(path: str) -> str:
    try:
        group = grp.getgrgid(os.stat(path).st_gid).gr_name
    except (OSError, KeyError):
        group = "video"
    return f"the group '{group}' may: run 'sudo usermod -aG {group} $USER' and log in again"


def _who_holds(path: str, proc: Path = Path("/proc")) -> str:
    """Name the processes that have the device open, as far as this user may see them."""
    target = os.path.realpath(path)
    holders = []
    for process in proc.glob("[0-9]*"):
        try:
            if any(os.path.realpath(link) == target for link in (process / "fd").iterdir()):
                holders.append(f"{(process / 'comm').read_text().strip()} (process {process.name})")
        except OSError:
            continue
    others = [holder for holder in holders if f"process {os.getpid()})" not in holder]
    return "it is used by " + ", ".join(others) if others else "another process uses it: try 'fuser -v " + path + "'"
