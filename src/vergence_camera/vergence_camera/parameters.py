"""The parameters of camera_node."""

from dataclasses import dataclass

from vergence_camera.capture_loop import Patience
from vergence_camera.errors import ChoiceError
from vergence_camera.frame import ModeRequest
from vergence_camera.source_choice import ALLOWED_DEVICES, SourceOptions, kind_of
from vergence_camera.v4l2.capture import READABLE_FORMATS
from vergence_rig.parameters import REQUIRED, Groups, ParameterError, Parameters, parameter


@dataclass(frozen=True)
class CameraParameters(Parameters):
    """One camera: which, how it streams, how patient the node is, and its partner eye."""

    device: str = parameter(
        REQUIRED,
        "camera (path, by-id or by-path name, number, USB serial), video file, folder of pictures, or URL",
        read_only=True,
    )
    pixel_format: str = parameter("MJPG", "format asked of a camera", choices=(*READABLE_FORMATS, ""), read_only=True)
    width_px: int = parameter(640, "width; 0 takes what there is", unit="px", minimum=0, maximum=8192, read_only=True)
    height_px: int = parameter(480, "height; 0 takes what there is", unit="px", minimum=0, maximum=8192, read_only=True)
    rate_hz: float = parameter(
        30.0, "rate asked of a camera; 0 leaves it", unit="Hz", minimum=0.0, maximum=1000.0, read_only=True
    )
    replay_rate_hz: float = parameter(
        0.0,
        "rate of a recording; 0 is its own (a folder: 30)",
        unit="Hz",
        minimum=0.0,
        maximum=1000.0,
        read_only=True,
    )
    replay_loop: bool = parameter(True, "begin a recording again at its end; false ends the node", read_only=True)
    camera_info_url: str = parameter(
        "",
        "calibration: file:///... or package://NAME/...; empty is ${ROS_HOME}/camera_info/${NAME}.yaml",
        read_only=True,
    )
    camera_name: str = parameter("", "name in the calibration; empty is the namespace's, or 'camera'", read_only=True)
    frame_id: str = parameter("", "optical frame; empty is <namespace>_camera_optical_frame", read_only=True)
    rig: str = parameter("", "rig.yaml, whose camera is compared with this one; empty is the built-in", read_only=True)
    stamp_offset_s: float = parameter(
        0.0, "measured time from mid-exposure to the capture time, subtracted", unit="s", minimum=-1.0, maximum=1.0
    )
    max_age_s: float = parameter(0.25, "older frames are dropped", unit="s", minimum=0.001, maximum=60.0)
    stall_timeout_s: float = parameter(
        1.0, "reconnect after this time without a whole frame", unit="s", minimum=0.05, maximum=60.0, read_only=True
    )
    open_timeout_s: float = parameter(
        5.0, "longest wait for a network stream to open", unit="s", minimum=0.1, maximum=60.0, read_only=True
    )
    first_retry_s: float = parameter(0.2, "wait before the first reconnect", unit="s", minimum=0.01, maximum=60.0)
    last_retry_s: float = parameter(5.0, "longest wait between reconnects", unit="s", minimum=0.01, maximum=600.0)
    drop_corrupt: bool = parameter(True, "false lets pass JPEGs without an end marker", read_only=True)
    buffers: int = parameter(4, "frames that the driver may hold", minimum=2, maximum=32, read_only=True)
    jpeg_quality: int = parameter(90, "for sources that are not JPEG, if someone wants JPEG", minimum=1, maximum=100)
    lock: str = parameter(
        "off",
        "exposure, gain, white balance: free, held where they are, or taken over from the partner",
        choices=("off", "hold", "follow"),
    )
    lock_after_s: float = parameter(
        2.0, "time for the automatic modes to settle before 'hold'", unit="s", minimum=0.0, maximum=60.0
    )
    partner: str = parameter("", "full name of the other eye's camera node; empty compares nothing", read_only=True)
    max_skew_s: float = parameter(
        0.02, "pairs further apart are reported: what the pairer accepts", unit="s", minimum=0.0, maximum=1.0
    )

    def check(self) -> None:
        """See Parameters."""
        try:
            kind_of(self.device)
        except ChoiceError:
            raise ParameterError("device", self.device, ALLOWED_DEVICES) from None
        if self.last_retry_s < self.first_retry_s:
            raise ParameterError("last_retry_s", self.last_retry_s, f"at least first_retry_s ({self.first_retry_s:g})")
        if self.lock == "follow" and not self.partner:
            raise ParameterError("lock", self.lock, "'off' or 'hold' while partner names no other camera node")

    def source_options(self) -> SourceOptions:
        """Return what the source has to know."""
        return SourceOptions(
            request=ModeRequest(self.pixel_format, self.width_px, self.height_px, self.rate_hz),
            replay_rate_hz=self.replay_rate_hz,
            replay_loop=self.replay_loop,
            open_timeout_s=self.open_timeout_s,
            stall_timeout_s=self.stall_timeout_s,
            drop_corrupt=self.drop_corrupt,
            buffers=self.buffers,
        )

    def patience(self) -> Patience:
        """Return what the capture loop has to know."""
        return Patience(
            stall_s=self.stall_timeout_s,
            max_age_s=self.max_age_s,
            first_retry_s=self.first_retry_s,
            last_retry_s=self.last_retry_s,
            stamp_offset_s=self.stamp_offset_s,
        )


GROUPS: Groups = (("", CameraParameters),)
