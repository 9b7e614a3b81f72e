"""What a page may ask for, and the check of every message that it sends.

Only these: goals of gaze/look_at, its cancellation, the stop, enable and park services, reading and setting parameters.
"""

import json
import math
from dataclasses import dataclass, field
from typing import Any

from vergence_rig.parameters import shown

LONGEST_MESSAGE = 16384
"""Of one message of a page [bytes]."""
_LONGEST_TEXT, _LONGEST_NAME = 4096, 256
_LARGEST_PX = 1e5
_LONGEST_LIST = 1024

COMMANDS = ("stop", "hold", "centre", "park", "enable", "disable", "cancel")
"""What a button asks for, without values."""


class RequestError(ValueError):
    """A message that is no valid request: names the thing, what must hold, and the value."""


@dataclass(frozen=True)
class Pixel:
    """Look at a pixel of an eye's raw image: x, y [px], the image's stamp [ns], size of the object, 0 if unknown."""

    left: bool
    x_px: float
    y_px: float
    stamp_ns: int
    width_px: float = 0.0
    height_px: float = 0.0


@dataclass(frozen=True)
class DetectedClass:
    """Look at a target of a class of the detector, wherever it is."""

    name: str


@dataclass(frozen=True)
class Command:
    """One of COMMANDS."""

    name: str


@dataclass(frozen=True)
class ListNodes:
    """The names of the nodes that have parameters."""


@dataclass(frozen=True)
class ReadParameters:
    """A node's parameters with descriptions, ranges and values; `node` is its full name."""

    node: str


@dataclass(frozen=True)
class SetParameter:
    """Set one parameter of a node."""

    node: str
    name: str
    value: bool | int | float | str | tuple[Any, ...]


@dataclass(frozen=True)
class Show:
    """What this page shows from now on: whether the metric's picture of the combined edges is wanted."""

    edges: bool


@dataclass(frozen=True)
class Drawn:
    """An update has been drawn: its number, and the time from its images' stamps to the screen [s], NaN if none."""

    number: int
    latency_s: float = math.nan


Request = Pixel | DetectedClass | Command | ListNodes | ReadParameters | SetParameter | Show | Drawn


@dataclass(frozen=True)
class Message:
    """A request with the page's own number of it, which the answer carries."""

    number: int
    request: Request


@dataclass(frozen=True)
class Answer:
    """What became of a request: whether it was done, in words, and values by name."""

    number: int
    ok: bool
    text: str
    values: dict[str, Any] = field(default_factory=dict)
    last: bool = True
    """False where another answer to the same request follows."""

    def as_json(self) -> str:
        """Return the answer as it is sent."""
        parts = {"answer": self.number, "ok": self.ok, "text": self.text, "last": self.last, **self.values}
        return json.dumps(parts, allow_nan=False)


def parse(text: str) -> Message:
    """Return the request of a message. Raises RequestError for anything else."""
    if len(text) > LONGEST_MESSAGE:
        raise RequestError(f"a message must have at most {LONGEST_MESSAGE} characters: got {len(text)}")
    try:
        values = json.loads(text, parse_constant=_no_constant)
    except (ValueError, RecursionError) as error:
        raise RequestError(f"a message must be JSON: got {shown(text)} ({error})") from error
    if not isinstance(values, dict):
        raise RequestError(f"a message must be a JSON object: got {shown(values)}")
    reader = _Reader(values)
    kind = reader.text("do")
    make = _KINDS.get(kind)
    if make is None:
        raise RequestError(f"do must be one of {', '.join(_KINDS)}: got {shown(kind)}")
    number = reader.whole("id", 0, 2**53)
    request = make(reader)
    reader.end()
    return Message(number, request)


class _Reader:
    """Reads values of a JSON object by name; each is checked, and none may be left over."""

    def __init__(self, values: dict[str, Any]) -> None:
        self._values = dict(values)

    def _pop(self, name: str) -> Any:
        if name not in self._values:
            raise RequestError(f"{name} must be given: it is missing")
        return self._values.pop(name)

    def has(self, name: str) -> bool:
        return name in self._values

    def text(self, name: str, longest: int = _LONGEST_NAME) -> str:
        value = self._pop(name)
        if not isinstance(value, str) or not 0 < len(value) <= longest:
            raise RequestError(f"{name} must be a text of 1 to {longest} characters: got {shown(value)}")
        return value

    def whole(self, name: str, low: int, high: int) -> int:
        value = self._pop(name)
        if type(value) is not int or not low <= value <= high:
            raise RequestError(f"{name} must be a whole number from {low} to {high}: got {shown(value)}")
        return value

    def number(self, name: str, low: float, high: float) -> float:
        value = self._pop(name)
        if type(value) not in (int, float) or not low <= value <= high:
            raise RequestError(f"{name} must be a number from {low:g} to {high:g}: got {shown(value)}")
        return float(value)

    def truth(self, name: str) -> bool:
        value = self._pop(name)
        if not isinstance(value, bool):
            raise RequestError(f"{name} must be true or false: got {shown(value)}")
        return value

    def stamp_ns(self, name: str) -> int:
        # As a text: JavaScript's numbers hold no more than 53 bits.
        value = self._pop(name)
        if not isinstance(value, str) or not value.isascii() or not value.isdigit() or len(value) > 19:
            raise RequestError(f"{name} must be nanoseconds, as a text of 1 to 19 digits: got {shown(value)}")
        return int(value)

    def parameter_value(self, name: str) -> Any:
        value = self._pop(name)
        if not isinstance(value, list):
            return _plain(name, value)
        if len(value) > _LONGEST_LIST or len({type(element) for element in value}) > 1:
            raise RequestError(f"{name} must be a list of at most {_LONGEST_LIST} values of one kind")
        return tuple(_plain(name, element) for element in value)

    def end(self) -> None:
        if self._values:
            raise RequestError(f"a message must have no other values: got {shown(sorted(self._values))}")


def _plain(name: str, value: Any) -> bool | int | float | str:
    whole = type(value) is int and -(2**63) <= value < 2**63
    number = isinstance(value, float) and math.isfinite(value)
    text = isinstance(value, str) and len(value) <= _LONGEST_TEXT
    if isinstance(value, bool) or whole or number or text:
        return value
    raise RequestError(
        f"{name} must be true, false, a number or a text of at most {_LONGEST_TEXT} characters: got {shown(value)}"
    )


def _no_constant(name: str) -> None:
    raise ValueError(f"{name} is no number in JSON")


def _pixel(reader: _Reader) -> Pixel:
    eye = reader.text("eye")
    if eye not in ("left", "right"):
        raise RequestError(f"eye must be left or right: got {shown(eye)}")
    x_px, y_px = (reader.number(name, -_LARGEST_PX, _LARGEST_PX) for name in ("x", "y"))
    stamp_ns = reader.stamp_ns("stamp")
    size = (0.0, 0.0)
    if reader.has("width") or reader.has("height"):
        size = reader.number("width", 1.0, _LARGEST_PX), reader.number("height", 1.0, _LARGEST_PX)
    return Pixel(eye == "left", x_px, y_px, stamp_ns, *size)


def _command(name: str) -> Any:
    return lambda reader: Command(name)


def _drawn(reader: _Reader) -> Drawn:
    number = reader.whole("update", 0, 2**53)
    return Drawn(number, reader.number("latency_s", -1e9, 1e9) if reader.has("latency_s") else math.nan)


_KINDS: dict[str, Any] = {
    "pixel": _pixel,
    "class": lambda reader: DetectedClass(reader.text("name")),
    **{name: _command(name) for name in COMMANDS},
    "nodes": lambda reader: ListNodes(),
    "parameters": lambda reader: ReadParameters(reader.text("node")),
    "set": lambda reader: SetParameter(reader.text("node"), reader.text("name"), reader.parameter_value("value")),
    "show": lambda reader: Show(reader.truth("edges")),
    "drawn": _drawn,
}
"""By the value of `do`: how the rest of a message is read."""
