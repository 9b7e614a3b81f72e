"""The parameters of camera_node."""

from dataclasses import dataclass

from vergence_camera.errors import ChoiceError
from vergence_camera.source_choice import allowed_devices, check_choice
from vergence_camera.v4l2.capture import READABLE_FORMATS
from vergence_rig.parameters import REQUIRED, Groups, ParameterError, Parameters, parameter


@dataclass(frozen=True)
class CameraParameters(Parameters):
    """One camera: which one, its mode, its calibration, its time-outs, and the other eye's camera."""

    device: str = parameter(
        REQUIRED,
        "camera (path, by-id or by-path name, number, USB serial), video file, folder of pictures, or URL",
        read_only=True,
    )
    pixel_format: str = parameter(
        "MJPG",
        "pixel format requested of the camera; empty accepts any",
        choices=(*READABLE_FORMATS, ""),
        read_only=True,
    )
    width_px: int = parameter(
        640, "image width requested; 0 accepts any", unit="px", minimum=0, maximum=8192, read_only=True
    )
    height_px: int = parameter(
        480, "image height requested; 0 accepts any", unit="px", minimum=0, maximum=8192, read_only=True
    )
    rate_hz: float = parameter(
        30.0,
        "frame rate requested of the camera; 0 keeps the camera's",
        unit="Hz",
        minimum=0.0,
        maximum=1000.0,
        read_only=True,
    )
    camera_info_url: str = parameter(
        "",
        "calibration file: file:///... or package://NAME/...; empty for ${ROS_HOME}/camera_info/${NAME}.yaml",
        read_only=True,
    )
    camera_name: str = parameter(
        "", "camera's name in the calibration file; empty for the namespace's last part, or 'camera'", read_only=True
    )
    frame_id: str = parameter("", "optical frame; empty for <namespace>_camera_optical_frame", read_only=True)
    rig: str = parameter(
        "", "path of rig.yaml, whose image size is compared with this camera's; empty for the built-in", read_only=True
    )
    stamp_offset_s: float = parameter(
        0.0,
        "measured time from the middle of the exposure to the capture time; it is subtracted from every stamp",
        unit="s",
        minimum=-1.0,
        maximum=1.0,
    )
    max_age_s: float = parameter(
        0.25, "largest age of a frame; an older one is dropped", unit="s", minimum=0.001, maximum=60.0
    )
    stall_timeout_s: float = parameter(
        1.0,
        "longest time without a whole frame, after which the camera is reconnected",
        unit="s",
        minimum=0.05,
        maximum=60.0,
        read_only=True,
    )
    open_timeout_s: float = parameter(
        5.0, "longest wait for a network stream to open", unit="s", minimum=0.1, maximum=60.0, read_only=True
    )
    drop_corrupt: bool = parameter(
        True, "drop JPEGs without an end marker; false accepts them, since a few cameras send none", read_only=True
    )
    buffers: int = parameter(4, "number of frames that the driver may buffer", minimum=2, maximum=32, read_only=True)
    jpeg_quality: int = parameter(
        90,
        "JPEG quality of image_raw/compressed from sources that are not JPEG",
        minimum=1,
        maximum=100,
    )
    lock: str = parameter(
        "off",
        "exposure, gain and white balance: 'off' leaves them automatic, 'hold' fixes them at their present values, "
        "'follow' copies the partner's",
        choices=("off", "hold", "follow"),
    )
    lock_after_s: float = parameter(
        2.0,
        "time that the automatic modes get to settle before lock 'hold' fixes them",
        unit="s",
        minimum=0.0,
        maximum=60.0,
    )
    partner: str = parameter(
        "", "full name of the other eye's camera node; empty compares the two cameras not at all", read_only=True
    )
    max_skew_s: float = parameter(
        0.035,
        "largest time between the two eyes' frames; a larger one is reported, since the metric nodes do not pair them",
        unit="s",
        minimum=0.0,
        maximum=1.0,
    )

    def check(self) -> None:
        """See Parameters."""
        try:
            check_choice(self.device)
        except ChoiceError:
            raise ParameterError("device", self.device, allowed_devices()) from None
        if self.lock == "follow" and not self.partner:
            raise ParameterError("lock", self.lock, "'off' or 'hold' while partner names no other camera node")


@dataclass(frozen=True)
class ReplayParameters(Parameters):
    """How a recording is played."""

    rate_hz: float = parameter(
        0.0,
        "frame rate of a recording; 0 for its own (30 Hz for a folder)",
        unit="Hz",
        minimum=0.0,
        maximum=1000.0,
        read_only=True,
        formerly="replay_rate_hz",
    )
    loop: bool = parameter(
        True,
        "play a recording again from its start when it ends; false ends the node",
        read_only=True,
        formerly="replay_loop",
    )


@dataclass(frozen=True)
class RetryParameters(Parameters):
    """Waits between attempts to reconnect a camera: doubling from the first to the longest."""

    first_s: float = parameter(
        0.2,
        "wait before a lost camera is first reconnected; it doubles with every failure",
        unit="s",
        minimum=0.01,
        maximum=60.0,
        formerly="first_retry_s",
    )
    longest_s: float = parameter(
        5.0,
        "longest wait between attempts to reconnect a camera",
        unit="s",
        minimum=0.01,
        maximum=600.0,
        formerly="last_retry_s",
    )

    def check(self) -> None:
        """See Parameters."""
        if self.longest_s < self.first_s:
            raise ParameterError("longest_s", self.longest_s, f"at least first_s, {self.first_s:g}")


GROUPS: Groups = (("", CameraParameters), ("replay.", ReplayParameters), ("retry.", RetryParameters))
