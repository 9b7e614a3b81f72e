"""A machine with webcams in it: a sysfs and /dev tree in a folder, and the fake kernel that belongs to it."""

from dataclasses import dataclass, field
from pathlib import Path

from vergence_camera.devices import SystemTree
from vergence_camera.testing.fake_camera import FakeCamera
from vergence_camera.testing.fake_kernel import FakeKernel


@dataclass
class FakeMachine:
    """Plug webcams in and out: the tree, the links of udev and the kernel change together."""

    root: Path
    kernel: FakeKernel = field(default_factory=lambda: FakeKernel({}))

    @property
    def tree(self) -> SystemTree:
        """Where the machine's files are."""
        return SystemTree(self.root / "sys", self.root / "dev")

    def plug_in(
        self,
        number: int,
        camera: FakeCamera | None = None,
        *,
        name: str = "HD Webcam C525",
        serial: str = "",
        port: str = "1-1",
        controller: str = "0000:00:14.0",
        vendor: str = "046d",
        product: str = "0826",
        speed: str = "480",
    ) -> FakeCamera:
        """Plug a camera in as /dev/video<number>, with its metadata device as the next number; return it."""
        bus, _, place = port.partition("-")
        usb = self.tree.sys / "devices" / "pci0000:00" / controller / f"usb{bus}" / port
        files = {"idVendor": vendor, "idProduct": product, "speed": speed} | ({"serial": serial} if serial else {})
        usb.mkdir(parents=True, exist_ok=True)
        (usb / "serial").unlink(missing_ok=True)
        for file, text in files.items():
            (usb / file).write_text(text + "\n")
        words = f"{vendor}_{name.replace(' ', '_')}" + (f"_{serial}" if serial else "")
        for index in (0, 1):
            node = f"video{number + index}"
            self._describe(usb / f"{port}:1.0", node, name, index)
            self._link("by-id", f"usb-{words}-video-index{index}", node)
            self._link("by-path", f"pci-{controller}-usb-0:{place}:1.0-video-index{index}", node)
        camera = camera or FakeCamera(card=name)
        if not camera.plugged:
            camera.plug_in()
        self.kernel.cameras[str(self.tree.dev / f"video{number}")] = camera
        return camera

    def unplug(self, number: int) -> FakeCamera:
        """Pull the camera out and return it; a process that has it open sees 'no such device'."""
        for node in (f"video{number}", f"video{number + 1}"):
            (self.tree.sys / "class" / "video4linux" / node).unlink()
            (self.tree.dev / node).unlink()
            for link in (self.tree.dev / "v4l").glob("by-*/*"):
                if link.readlink().name == node:
                    link.unlink()
        camera = self.kernel.cameras.pop(str(self.tree.dev / f"video{number}"))
        camera.unplug()
        return camera

    def _describe(self, interface: Path, node: str, name: str, index: int) -> None:
        video = interface / "video4linux" / node
        video.mkdir(parents=True, exist_ok=True)
        (video / "name").write_text(f"{name}: {name}\n")
        (video / "index").write_text(f"{index}\n")
        if not (video / "device").is_symlink():
            (video / "device").symlink_to(interface, target_is_directory=True)
        entry = self.tree.sys / "class" / "video4linux" / node
        entry.parent.mkdir(parents=True, exist_ok=True)
        entry.symlink_to(video, target_is_directory=True)
        self.tree.dev.mkdir(parents=True, exist_ok=True)
        (self.tree.dev / node).touch()

    def _link(self, kind: str, link: str, node: str) -> None:
        path = self.tree.dev / "v4l" / kind / link
        path.parent.mkdir(parents=True, exist_ok=True)
        # Twins without serials fight for one by-id name: the later one wins, as with udev.
        path.unlink(missing_ok=True)
        path.symlink_to(Path("..") / ".." / node)
