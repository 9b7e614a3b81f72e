"""The controls of a camera (exposure, gain, white balance, ...): listing them, and setting several at once."""

import contextlib
import errno
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from vergence_camera.errors import CameraError, ControlError
from vergence_camera.v4l2 import structures as v4l2
from vergence_camera.v4l2.faults import camera_error
from vergence_camera.v4l2.kernel import Kernel

Value = bool | int | str

_SCALARS = {v4l2.CTRL_INTEGER, v4l2.CTRL_BOOLEAN, v4l2.CTRL_MENU, v4l2.CTRL_INTEGER_MENU}


@dataclass(frozen=True)
class ControlSpec:
    """One control.

    `name` is the driver's, in lower case with underscores, as `v4l2-ctl` writes it. A boolean takes True or False, a
    menu one of the texts in `menu`, everything else a whole number from `minimum` to `maximum` in steps of `step`.
    `active` is False while an automatic mode owns the control.
    """

    cid: int
    name: str
    kind: int
    minimum: int
    maximum: int
    step: int
    default: int
    menu: Mapping[int, str]
    read_only: bool
    active: bool
    governs_others: bool

    @property
    def is_boolean(self) -> bool:
        """True if the values are True and False."""
        return self.kind == v4l2.CTRL_BOOLEAN

    @property
    def is_menu(self) -> bool:
        """True if the values are the menu's texts."""
        return self.kind in (v4l2.CTRL_MENU, v4l2.CTRL_INTEGER_MENU)

    @property
    def allowed(self) -> str:
        """What the value must be, in words."""
        if self.is_boolean:
            return "true or false"
        if self.is_menu:
            return "one of " + ", ".join(repr(text) for text in self.menu.values())
        steps = f" in steps of {self.step}" if self.step > 1 else ""
        return f"a whole number from {self.minimum} to {self.maximum}{steps}"

    def to_number(self, value: object) -> int:
        """Return the driver's number for a value; raise ControlError if it is not allowed."""
        number: int | None = None
        if self.is_boolean:
            number = int(value) if isinstance(value, bool) else None
        elif self.is_menu:
            number = next((index for index, text in self.menu.items() if text == value), None)
        elif isinstance(value, int) and not isinstance(value, bool) and self.minimum <= value <= self.maximum:
            number = value if (value - self.minimum) % max(1, self.step) == 0 else None
        if number is None:
            raise ControlError(f"control '{self.name}' must be {self.allowed}: got {value!r}")
        return number

    def to_value(self, number: int) -> Value:
        """Return the value for the driver's number."""
        if self.is_boolean:
            return bool(number)
        return self.menu.get(number, f"{number}") if self.is_menu else number


class Controls:
    """The controls of one open device; safe to use from another thread than the one that streams."""

    def __init__(self, kernel: Kernel, descriptor: int, path: str) -> None:
        self._kernel, self._descriptor, self._path = kernel, descriptor, path

    def specs(self) -> dict[str, ControlSpec]:
        """Return every control by name, as it is now."""
        return {spec.name: spec for spec in self._enumerate()}

    def get(self, spec: ControlSpec) -> Value:
        """Return a control's present value."""
        return spec.to_value(self._read(spec))

    def values(self) -> dict[str, Value]:
        """Return the present value of every control that can be read; some cameras list ones that cannot."""
        values = {}
        for name, spec in self.specs().items():
            with contextlib.suppress(ControlError):
                values[name] = self.get(spec)
        return values

    def check(self, changes: Mapping[str, object]) -> dict[str, int]:
        """Return the driver's numbers for `changes`; raise ControlError for the first that is not allowed."""
        specs = self.specs()
        numbers = {}
        for name, value in changes.items():
            spec = specs.get(name)
            if spec is None:
                raise ControlError(f"there is no control '{name}': the camera has {', '.join(specs)}")
            if spec.read_only:
                raise ControlError(f"control '{name}' is read-only")
            numbers[name] = spec.to_number(value)
        return numbers

    def apply(self, changes: Mapping[str, object]) -> dict[str, Value]:
        """Set all of `changes` or none, and return what the camera has then.

        Everything is validated before anything is set. Automatic modes are set first, since they free or own others;
        where the camera then refuses a value, those already set get their former values back.
        """
        numbers = self.check(changes)
        specs = self.specs()
        done: list[tuple[ControlSpec, int]] = []
        try:
            for name in sorted(numbers, key=lambda name: not specs[name].governs_others):
                spec = self._query(specs[name].cid) or specs[name]
                former = self._read(spec)
                if former == numbers[name]:
                    continue
                if not spec.active:
                    raise ControlError(f"control '{name}' is held by an automatic mode: {self._owner(specs)}")
                self._write(spec, numbers[name])
                done.append((spec, former))
        except CameraError:
            for spec, former in reversed(done):
                self._write(spec, former)
            raise
        return {name: self.get(specs[name]) for name in numbers}

    def _owner(self, specs: Mapping[str, ControlSpec]) -> str:
        owners = [spec for spec in specs.values() if spec.governs_others]
        return "turn it off first (" + ", ".join(f"{s.name} is {self.get(s)!r}" for s in owners) + ")"

    def _enumerate(self) -> Iterator[ControlSpec]:
        seen: set[str] = set()
        cid = 0
        while (answer := self._ask(cid | v4l2.FLAG_NEXT_CTRL)) is not None:
            cid = answer.id
            spec = self._spec(answer)
            if spec is not None and spec.name not in seen:
                seen.add(spec.name)
                yield spec

    def _query(self, cid: int) -> ControlSpec | None:
        answer = self._ask(cid)
        return None if answer is None else self._spec(answer)

    def _ask(self, cid: int) -> v4l2.QueryExtControl | v4l2.QueryControl | None:
        extended = v4l2.QueryExtControl(id=cid)
        try:
            self._kernel.ioctl(self._descriptor, v4l2.QUERY_EXT_CTRL, extended)
            return extended
        except OSError as error:
            if error.errno == errno.EINVAL:
                return None
            if error.errno != errno.ENOTTY:
                raise camera_error(error, "asking for its controls", self._path) from error
        plain = v4l2.QueryControl(id=cid)
        try:
            self._kernel.ioctl(self._descriptor, v4l2.QUERYCTRL, plain)
            return plain
        except OSError as error:
            if error.errno in (errno.EINVAL, errno.ENOTTY):
                return None
            raise camera_error(error, "asking for its controls", self._path) from error

    def _spec(self, answer: v4l2.QueryExtControl | v4l2.QueryControl) -> ControlSpec | None:
        """Return None for what is no setting: headings, buttons, arrays, texts, and controls switched off."""
        hidden = v4l2.FLAG_DISABLED | v4l2.FLAG_WRITE_ONLY | v4l2.FLAG_HAS_PAYLOAD
        if answer.type not in _SCALARS or answer.flags & hidden:
            return None
        return ControlSpec(
            cid=answer.id,
            name=re.sub(r"[^a-z0-9]+", "_", answer.name.decode("utf-8", "replace").lower()).strip("_"),
            kind=answer.type,
            minimum=answer.minimum,
            maximum=answer.maximum,
            step=answer.step,
            default=answer.default_value,
            menu=self._menu(answer) if answer.type in (v4l2.CTRL_MENU, v4l2.CTRL_INTEGER_MENU) else {},
            read_only=bool(answer.flags & v4l2.FLAG_READ_ONLY),
            active=not answer.flags & (v4l2.FLAG_INACTIVE | v4l2.FLAG_GRABBED),
            governs_others=bool(answer.flags & v4l2.FLAG_UPDATE) or answer.id in _KNOWN_GOVERNORS,
        )

    def _menu(self, answer: v4l2.QueryExtControl | v4l2.QueryControl) -> dict[int, str]:
        items = {}
        for index in range(answer.minimum, answer.maximum + 1):
            item = v4l2.QueryMenu(id=answer.id, index=index)
            try:
                self._kernel.ioctl(self._descriptor, v4l2.QUERYMENU, item)
            except OSError as error:
                if error.errno == errno.EINVAL:  # menus have holes
                    continue
                raise camera_error(error, "asking for a menu", self._path) from error
            is_number = answer.type == v4l2.CTRL_INTEGER_MENU
            items[index] = str(item.item.value) if is_number else item.item.name.decode("utf-8", "replace")
        return items

    def _read(self, spec: ControlSpec) -> int:
        control = v4l2.Control(id=spec.cid)
        try:
            self._kernel.ioctl(self._descriptor, v4l2.G_CTRL, control)
        except OSError as error:
            if error.errno in _REFUSALS:
                raise ControlError(f"control '{spec.name}' cannot be read: {error.strerror}") from error
            raise camera_error(error, f"reading control '{spec.name}'", self._path) from error
        return control.value

    def _write(self, spec: ControlSpec, number: int) -> None:
        try:
            self._kernel.ioctl(self._descriptor, v4l2.S_CTRL, v4l2.Control(id=spec.cid, value=number))
        except OSError as error:
            if error.errno in _REFUSALS:
                raise ControlError(
                    f"control '{spec.name}' must be {spec.allowed}: the camera refuses {spec.to_value(number)!r} "
                    f"({error.strerror})"
                ) from error
            raise camera_error(error, f"setting control '{spec.name}'", self._path) from error


# A UVC camera that stalls a control request fails with EPIPE or EIO; the stream is not affected.
_REFUSALS = {errno.EINVAL, errno.ERANGE, errno.EACCES, errno.EBUSY, errno.EPERM, errno.EPIPE, errno.EIO}
_KNOWN_GOVERNORS = {v4l2.CID_EXPOSURE_AUTO, v4l2.CID_AUTO_WHITE_BALANCE, v4l2.CID_AUTOGAIN}
