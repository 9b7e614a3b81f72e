"""One exception per failure of a camera; each message says what failed and how to solve it."""


class CameraError(OSError):
    """A failure of a camera. `permanent`: retrying cannot help, the user has to change something."""

    permanent = False

    @property
    def kind(self) -> str:
        """The name under which diagnostics count this failure: `UsbBandwidthError` is `usb_bandwidth`."""
        name = type(self).__name__.removesuffix("Error")
        return "".join(f"_{letter.lower()}" if letter.isupper() else letter for letter in name).lstrip("_")


class ChoiceError(CameraError, ValueError):
    """A text that cannot name any camera, file or URL."""

    permanent = True


class CameraNotFoundError(CameraError):
    """No camera of that name now; the message lists those that are there."""


class AmbiguousCameraError(CameraError, ValueError):
    """Several cameras have that name; the message lists them."""

    permanent = True


class FileMissingError(CameraError, ValueError):
    """No such video file or image folder, or nothing readable in it."""

    permanent = True


class ModeMismatchError(CameraError, ValueError):
    """The camera's size or pixel format is not the requested one; the message names both."""

    permanent = True


class UnsupportedError(CameraError, ValueError):
    """A device, file or stream of a kind that this package cannot read."""

    permanent = True


class PermissionDeniedError(CameraError):
    """The user may not open the device; the message names the group that may."""


class DeviceBusyError(CameraError):
    """Another process streams from the device; the message names it where that can be seen."""


class UsbBandwidthError(CameraError):
    """The USB controller has no bandwidth left for this stream ("No space left on device")."""


class UnpluggedError(CameraError):
    """The device went away while it was open."""


class StalledError(CameraError):
    """The device or stream is open, but sent no frame for too long."""


class DisconnectedError(CameraError):
    """The network stream could not be opened, or ended."""


class CorruptFrameError(CameraError):
    """One frame that is not whole; the next one may be."""


class TruncatedFileError(CorruptFrameError):
    """The video file ends in the middle of a frame."""


class WrongSizeError(CorruptFrameError):
    """One frame whose size is not the one agreed on when the stream began."""


class ReplayEndedError(CameraError):
    """The file or folder has been played once, as requested."""


class ControlError(CameraError, ValueError):
    """An invalid value of a control; the message says what it must be."""

    permanent = True
