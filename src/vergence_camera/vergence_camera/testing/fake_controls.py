"""The controls of a webcam that exists only in tests."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from vergence_camera.v4l2 import structures as v4l2


@dataclass
class FakeControl:
    """One control of a fake camera. `menu` maps indices to names; `governs` maps a value to CIDs it makes inactive."""

    cid: int
    name: str
    kind: int
    minimum: int
    maximum: int
    step: int
    default: int
    flags: int = 0
    menu: Mapping[int, str] = field(default_factory=dict)
    governs: Mapping[int, tuple[int, ...]] = field(default_factory=dict)
    read_errno: int = 0
    value: int = 0

    def __post_init__(self) -> None:
        self.value = self.default


def webcam_controls() -> list[FakeControl]:
    """Return the controls of a common UVC webcam."""
    exposure, gain, balance = v4l2.CID_EXPOSURE_ABSOLUTE, v4l2.CID_GAIN, v4l2.CID_WHITE_BALANCE_TEMPERATURE
    power = {0: "Disabled", 1: "50 Hz", 2: "60 Hz"}
    modes = {1: "Manual Mode", 3: "Aperture Priority Mode"}
    update = v4l2.FLAG_UPDATE
    return [
        FakeControl(0x00980001, "User Controls", v4l2.CTRL_CLASS, 0, 0, 0, 0, v4l2.FLAG_READ_ONLY),
        FakeControl(0x00980900, "Brightness", v4l2.CTRL_INTEGER, -64, 64, 1, 0),
        FakeControl(
            v4l2.CID_AUTO_WHITE_BALANCE,
            "White Balance, Automatic",
            v4l2.CTRL_BOOLEAN,
            *(0, 1, 1, 1),
            update,
            governs={1: (balance,)},
        ),
        FakeControl(gain, "Gain", v4l2.CTRL_INTEGER, 0, 100, 1, 16),
        FakeControl(0x00980918, "Power Line Frequency", v4l2.CTRL_MENU, 0, 2, 1, 1, menu=power),
        FakeControl(balance, "White Balance Temperature", v4l2.CTRL_INTEGER, 2800, 6500, 10, 4600),
        FakeControl(0x009A0001, "Camera Controls", v4l2.CTRL_CLASS, 0, 0, 0, 0, v4l2.FLAG_READ_ONLY),
        FakeControl(
            v4l2.CID_EXPOSURE_AUTO,
            "Auto Exposure",
            v4l2.CTRL_MENU,
            *(0, 3, 1, 3),
            update,
            menu=modes,
            governs={3: (exposure,)},
        ),
        FakeControl(exposure, "Exposure Time, Absolute", v4l2.CTRL_INTEGER, 3, 2047, 1, 250),
        FakeControl(0x009A090A, "Focus, Absolute", v4l2.CTRL_INTEGER, 0, 250, 5, 0),
        FakeControl(0x009A0910, "Pan, Reset", v4l2.CTRL_BUTTON, 0, 0, 0, 0, v4l2.FLAG_WRITE_ONLY),
    ]
