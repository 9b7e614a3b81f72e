"""list_cameras: a table of the cameras that are plugged in."""

import argparse
import sys
from collections.abc import Sequence

from vergence_camera.devices import ListedDevice, list_devices
from vergence_camera.v4l2.kernel import LinuxKernel


def table(listed: Sequence[ListedDevice]) -> str:
    """Return the cameras as text, one block each."""
    if not listed:
        return (
            "no cameras: nothing under /sys/class/video4linux. Is it plugged in? In a container, is it passed through?"
        )
    blocks = []
    for entry in listed:
        device = entry.device
        lines = [f"{device.number}: {device.name}   {device.path}"]
        usb = f"{device.vendor}:{device.product}" if device.vendor else "no USB device"
        port = f"port {device.usb_port} ({device.speed_mbps} Mbit/s) on controller {device.controller}"
        lines.append(f"   usb      {usb}   serial {device.serial or '-'}   {port if device.usb_port else ''}".rstrip())
        lines += [f"   by-id    {link}" for link in device.by_id]
        lines += [f"   by-path  {link}" for link in device.by_path]
        if entry.trouble:
            lines.append(f"   formats  not known: {entry.trouble}")
        for code in dict.fromkeys(size.pixel_format for size in entry.sizes):
            sizes = [size for size in entry.sizes if size.pixel_format == code]
            lines.append(f"   {code:<8} " + ", ".join(_size(s.width_px, s.height_px, s.rates_hz) for s in sizes))
        blocks.append("\n".join(lines))
    return "\n".join(blocks) + _shared_controllers(listed)


def _size(width_px: int, height_px: int, rates_hz: Sequence[float]) -> str:
    return f"{width_px}x{height_px}@{'/'.join(f'{rate:g}' for rate in rates_hz) or '?'}"


def _shared_controllers(listed: Sequence[ListedDevice]) -> str:
    controllers = [entry.device.controller for entry in listed if entry.device.controller]
    shared = sorted({name for name in controllers if controllers.count(name) > 1})
    return "".join(f"\nnote: several cameras share USB controller {name} and its bandwidth" for name in shared)


def main(args: Sequence[str] | None = None) -> int:
    """Print the table; 0 also when there is no camera."""
    argparse.ArgumentParser(prog="list_cameras", description=__doc__).parse_args(args)
    print(table(list_devices(LinuxKernel())))
    return 0


if __name__ == "__main__":
    sys.exit(main())
