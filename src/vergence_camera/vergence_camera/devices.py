"""Which cameras are plugged in, by sysfs and the stable names that udev gives them."""

import os
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from vergence_camera.errors import AmbiguousCameraError, CameraError, CameraNotFoundError, ChoiceError
from vergence_camera.v4l2.formats import OfferedSize, offered_sizes, query_capture
from vergence_camera.v4l2.kernel import Kernel


@dataclass(frozen=True)
class SystemTree:
    """The roots of sysfs and of the device nodes; tests use their own."""

    sys: Path = Path("/sys")
    dev: Path = Path("/dev")


@dataclass(frozen=True)
class Device:
    """One camera. Empty texts where the bus has no such thing; `usb_port` is the kernel's, such as `1-1.2`."""

    path: str
    number: int
    name: str
    by_id: tuple[str, ...] = ()
    by_path: tuple[str, ...] = ()
    vendor: str = ""
    product: str = ""
    serial: str = ""
    usb_port: str = ""
    controller: str = ""
    speed_mbps: str = ""

    @property
    def names(self) -> tuple[str, ...]:
        """Every text that chooses this camera exactly."""
        links = [*self.by_id, *self.by_path]
        short = [Path(link).name for link in links]
        others = [self.serial, self.usb_port, self.name]
        return tuple(text for text in (self.path, *links, *short, *others) if text)

    def __str__(self) -> str:
        stable = (*self.by_id, *self.by_path)
        details = [f"serial {self.serial}" if self.serial else "no serial", *stable[:2]]
        return f"{self.path} '{self.name}' ({', '.join(details)})"


@dataclass(frozen=True)
class ListedDevice:
    """A device with its modes, or why they could not be read."""

    device: Device
    sizes: Sequence[OfferedSize] = ()
    trouble: str = ""
    error: OSError | None = None


def find_devices(tree: SystemTree | None = None) -> list[Device]:
    """Return every video device that can be a camera, by number; nothing is opened.

    A UVC camera has a second device for metadata, which the kernel gives an index of 1: those are left out.
    """
    tree = tree or SystemTree()
    by_id, by_path = _links(tree.dev / "v4l" / "by-id"), _links(tree.dev / "v4l" / "by-path")
    devices = []
    for entry in sorted((tree.sys / "class" / "video4linux").glob("video*"), key=_number):
        if _read(entry / "index") not in ("", "0"):
            continue
        path = tree.dev / entry.name
        usb = _usb_device(entry)
        devices.append(
            Device(
                path=str(path),
                number=_number(entry),
                name=_read(entry / "name"),
                by_id=by_id.get(entry.name, ()),
                by_path=by_path.get(entry.name, ()),
                vendor=_read(usb / "idVendor") if usb else "",
                product=_read(usb / "idProduct") if usb else "",
                serial=_read(usb / "serial") if usb else "",
                usb_port=usb.name if usb else "",
                controller=_controller(usb) if usb else "",
                speed_mbps=_read(usb / "speed") if usb else "",
            )
        )
    return devices


def list_devices(kernel: Kernel, tree: SystemTree | None = None) -> list[ListedDevice]:
    """Return every camera with its formats; one that cannot be opened is listed with the reason."""
    listed = []
    for device in find_devices(tree):
        try:
            descriptor = kernel.open(device.path)
        except OSError as error:
            listed.append(ListedDevice(device, trouble=os.strerror(error.errno or 0), error=error))
            continue
        try:
            query_capture(kernel, descriptor, device.path)
            listed.append(ListedDevice(device, offered_sizes(kernel, descriptor)))
        except CameraError as error:
            if not error.permanent:
                listed.append(ListedDevice(device, trouble=str(error), error=error))
        finally:
            kernel.close(descriptor)
    return listed


def choose(text: str, devices: Sequence[Device]) -> Device:
    """Return the one device that `text` names.

    Args:
        text: a path (`/dev/video0`, `/dev/v4l/by-id/...`), a number, a by-id or by-path name, a USB serial, a USB
            port (`1-1.2`) or the camera's name. `serial:`, `port:` or `number:` in front says which is meant.

    Raises:
        CameraNotFoundError, AmbiguousCameraError: with the candidates.
    """
    rule, _, rest = text.partition(":")
    tests: dict[str, Callable[[Device], bool]] = {
        "serial": lambda d: d.serial == rest,
        "port": lambda d: d.usb_port == rest,
        "number": lambda d: str(d.number) == rest,
    }
    if rule in tests:
        if not rest:
            raise ChoiceError(f"camera '{text}': a value must follow '{rule}:'")
        found = [device for device in devices if tests[rule](device)]
    elif re.fullmatch(r"\d{1,3}", text):
        found = [device for device in devices if device.number == int(text)]
    else:
        found = [device for device in devices if text in device.names]
    if not found:
        raise CameraNotFoundError(f"camera '{text}' is not plugged in; {_candidates(devices)}")
    if len(found) > 1:
        raise AmbiguousCameraError(
            f"camera '{text}' may be {len(found)} cameras: choose by a by-path name; {_candidates(found)}"
        )
    return found[0]


@dataclass
class PinnedChoice:
    """A choice that keeps to the camera it first found, also when that is plugged in elsewhere.

    A camera with a unique serial is recognised in any port; others are recognised by their port.
    """

    text: str
    tree: SystemTree = field(default_factory=SystemTree)
    device: Device | None = None
    _by_serial: bool = False

    def resolve(self) -> str:
        """Return the present path of the camera; raise as `choose` does."""
        devices = find_devices(self.tree)
        if self.device is None:
            self.device = self._choose(devices)
            twins = [d for d in devices if self._same_kind(d) and d.serial == self.device.serial]
            self._by_serial = bool(self.device.serial) and len(twins) == 1
            return self.device.path
        if self.device.number < 0 and os.path.exists(self.device.path):
            return self.device.path
        present = [device for device in devices if self._is_it(device)]
        if not present:
            raise CameraNotFoundError(f"camera {self.device} was unplugged; {_candidates(devices)}")
        self.device = present[0]
        return self.device.path

    def _choose(self, devices: Sequence[Device]) -> Device:
        try:
            return choose(self.text, devices)
        except CameraNotFoundError:
            # A device node that sysfs does not list, as in a container: only its path identifies it.
            if self.text.startswith("/dev/") and os.path.exists(self.text):
                return Device(path=self.text, number=-1, name=self.text)
            raise

    def _same_kind(self, other: Device) -> bool:
        assert self.device is not None
        return (other.vendor, other.product) == (self.device.vendor, self.device.product)

    def _is_it(self, other: Device) -> bool:
        assert self.device is not None
        if not self._same_kind(other):
            return False
        if self._by_serial:
            return other.serial == self.device.serial
        if self.device.usb_port:
            return other.usb_port == self.device.usb_port
        return other.path == self.device.path


def _candidates(devices: Sequence[Device]) -> str:
    if not devices:
        return "no camera is plugged in"
    return "there are: " + "; ".join(str(device) for device in devices)


def _links(directory: Path) -> dict[str, tuple[str, ...]]:
    """Return the links of a directory by the name of the device they lead to."""
    found: dict[str, tuple[str, ...]] = {}
    if directory.is_dir():
        for link in sorted(directory.iterdir()):
            target = os.path.basename(os.readlink(link)) if link.is_symlink() else link.name
            found[target] = (*found.get(target, ()), str(link))
    return found


def _number(entry: Path) -> int:
    digits = re.sub(r"\D", "", entry.name)
    return int(digits) if digits else -1


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8", errors="replace").strip()
    except OSError:
        return ""


def _usb_device(entry: Path) -> Path | None:
    """Return the directory of the USB device (not of its interface) behind a video device."""
    device = Path(os.path.realpath(entry / "device"))
    return next((d for d in (device, *device.parents) if (d / "idVendor").exists()), None)


def _controller(usb: Path) -> str:
    """Return the name of what the root hub `usbN` hangs on: a PCI address, or a platform device on a Pi."""
    root = next((d for d in (usb, *usb.parents) if re.fullmatch(r"usb\d+", d.name)), None)
    return root.parent.name if root else ""
