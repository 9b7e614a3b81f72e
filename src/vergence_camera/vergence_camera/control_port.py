"""The controls of a camera that may be reconnected: values that were set are set again afterwards."""

import threading
from collections.abc import Callable, Mapping

from vergence_camera.errors import CameraError, ControlError, DisconnectedError
from vergence_camera.v4l2 import structures as v4l2
from vergence_camera.v4l2.controls import Controls, ControlSpec, Value
from vergence_camera.v4l2.kernel import Kernel

# What is switched off, in order, and what is then the same for both eyes.
_AUTOMATIC = {
    v4l2.CID_EXPOSURE_AUTO: v4l2.EXPOSURE_MANUAL,
    v4l2.CID_EXPOSURE_AUTO_PRIORITY: 0,
    v4l2.CID_AUTO_WHITE_BALANCE: 0,
    v4l2.CID_AUTOGAIN: 0,
}
_LOCKED = (v4l2.CID_EXPOSURE_ABSOLUTE, v4l2.CID_GAIN, v4l2.CID_WHITE_BALANCE_TEMPERATURE)


class ControlPort:
    """Reads and sets the controls; safe to use from any thread. It is the DeviceUser of the source.

    `log` gets a line for each stored value that the camera refuses after a reconnect.
    """

    def __init__(self, log: Callable[[str], None] = lambda text: None) -> None:
        self._log = log
        self._lock = threading.RLock()
        self._controls: Controls | None = None
        self._specs: dict[str, ControlSpec] = {}
        self._stored: dict[str, object] = {}
        self.generation = 0

    def attach(self, kernel: Kernel, descriptor: int, path: str) -> None:
        """See DeviceUser: the stored values are set again, since a camera loses them when it is unplugged."""
        with self._lock:
            self._controls = Controls(kernel, descriptor, path)
            self._specs = self._controls.specs()
            try:
                if self._stored:
                    self._controls.apply(self._stored)
            except ControlError as error:
                if self.generation == 0:
                    self._controls = None
                    raise
                self._log(str(error))
            self.generation += 1

    def detach(self) -> None:
        """See DeviceUser."""
        with self._lock:
            self._controls = None

    @property
    def attached(self) -> bool:
        """True while the device is open."""
        with self._lock:
            return self._controls is not None

    def set_initial(self, values: Mapping[str, object]) -> None:
        """Set `values` at every connection; called before the first."""
        with self._lock:
            self._stored.update(values)

    def specs(self) -> dict[str, ControlSpec]:
        """Return the controls of the camera that was last connected; empty before the first."""
        with self._lock:
            return dict(self._specs)

    def values(self) -> dict[str, Value]:
        """Return the camera's present values; empty while it is not connected."""
        with self._lock:
            try:
                return self._controls.values() if self._controls is not None else {}
            except CameraError:  # it is just being unplugged; the capture thread reports that
                return {}

    def set(self, changes: Mapping[str, object]) -> dict[str, Value]:
        """Set all of `changes` or none (see Controls.apply), and again at every later connection."""
        with self._lock:
            result = self._present().apply(changes)
            self._stored.update(changes)
            return result

    def follow(self, leader: Mapping[str, object]) -> dict[str, Value]:
        """Switch the automatic modes off and copy exposure, gain and white balance from the other eye.

        Args:
            leader: control values by name; those that this camera lacks are left out, numbers beyond its range are
                clipped to it. A control that is missing keeps its present value, so that {} fixes them all.

        Returns:
            The controls that were set, and their values.

        Raises:
            ControlError: an automatic mode of the leader is still on, so that its values are not final.
        """
        with self._lock:
            controls = self._present()
            specs = controls.specs()
            for spec in specs.values():
                if spec.cid in _AUTOMATIC and leader.get(spec.name, None) not in (None, _manual(spec)):
                    raise ControlError(
                        f"the partner's {spec.name} is {leader[spec.name]!r}: its exposure is not fixed yet, set its "
                        "lock to 'hold'"
                    )
            present = controls.values()
            changes: dict[str, object] = {}
            for spec in specs.values():
                if spec.read_only:
                    continue
                if spec.cid in _AUTOMATIC:
                    if not spec.is_menu or _AUTOMATIC[spec.cid] in spec.menu:
                        changes[spec.name] = _manual(spec)
                elif spec.cid in _LOCKED and spec.name in present:
                    changes[spec.name] = _clipped(spec, leader.get(spec.name, present[spec.name]))
            return self.set(changes)

    def locked_names(self) -> tuple[str, ...]:
        """Return the names of the controls that both eyes must have in common."""
        with self._lock:
            return tuple(spec.name for spec in self._specs.values() if spec.cid in _LOCKED or spec.cid in _AUTOMATIC)

    def _present(self) -> Controls:
        if self._controls is None:
            raise DisconnectedError("the camera is not connected: its controls cannot be set now")
        return self._controls


def _manual(spec: ControlSpec) -> Value:
    """Return the value that switches an automatic mode off."""
    return spec.to_value(_AUTOMATIC[spec.cid])


def _clipped(spec: ControlSpec, value: object) -> object:
    if not isinstance(value, int) or isinstance(value, bool):
        return value
    steps = round((min(max(value, spec.minimum), spec.maximum) - spec.minimum) / max(1, spec.step))
    return min(spec.minimum + steps * max(1, spec.step), spec.maximum)
