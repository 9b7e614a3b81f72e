"""Parameter sets as frozen dataclasses that describe and validate themselves.

One declaration serves the pure code (a plain dataclass), the ROS rim (type, unit, range and description for the
parameter descriptors) and the shipped YAML (a test holds it equal to the defaults)::

    @dataclass(frozen=True)
    class EdgeParameters(Parameters):
        blur_sigma_px: float = parameter(1.4, "Gaussian blur before Canny", unit="px", minimum=0.0, maximum=10.0)
        device: str = parameter(REQUIRED, "which camera", read_only=True)

        def check(self) -> None:
            if ...: raise ParameterError("blur_sigma_px", self.blur_sigma_px, "less than ...")
"""

import dataclasses
import math
import reprlib
import typing
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

from vergence_rig.spelling import spelling_hint

_KEY = "vergence_parameter"


class _Required:
    def __repr__(self) -> str:
        return "REQUIRED"


REQUIRED: Any = _Required()
"""Default of a parameter that has no sensible one: the user must give it."""


_LONGEST_SHOWN = 200
_REPR = reprlib.Repr()
_REPR.maxlevel, _REPR.maxother = 4, _LONGEST_SHOWN
_REPR.maxstring = _REPR.maxlong = _LONGEST_SHOWN
_REPR.maxdict = _REPR.maxlist = _REPR.maxtuple = _REPR.maxset = 20


def shown(value: object) -> str:
    """Return a value as it stands in an error message: at most some 200 characters of it.

    Only the beginning of a container is looked at: a small YAML file can be one of billions of elements.
    """
    try:
        text = _REPR.repr(value)
    except ValueError:  # Python writes no integer of more than 4300 digits
        return "a number of more than 4300 digits"
    except RecursionError:
        return "a value nested too deeply to show"
    return text if len(text) <= _LONGEST_SHOWN else f"{text[: _LONGEST_SHOWN - 3]}..."


class ParameterError(ValueError):
    """An invalid parameter value: the message names the parameter, what it must be, and the value given.

    `allowed` completes the sentence "parameter 'X' must be ...". `hint` says how to spell what was probably meant, with
    NAME for the name.
    """

    def __init__(self, name: str, value: object, allowed: str, hint: str = "") -> None:
        self.name, self.value, self.allowed, self.hint = name, value, allowed, hint
        super().__init__(f"parameter '{name}' must be {allowed}: got {shown(value)}{self.advice}")

    @property
    def advice(self) -> str:
        """The hint as the end of a sentence; "" without one."""
        return f"; {self.hint.replace('NAME', self.name)}" if self.hint else ""

    def prefixed(self, prefix: str) -> "ParameterError":
        """Return the same error with `prefix` before the parameter's name: the group or the file's key it stands in."""
        return ParameterError(f"{prefix}{self.name}", self.value, self.allowed, self.hint)


class RenamedParameterError(ParameterError):
    """A parameter given by a name that it no longer has."""

    def __init__(self, name: str, value: object, new_name: str, unit: str) -> None:
        in_unit = f" (in {unit})" if unit else ""
        ValueError.__init__(self, f"parameter '{name}' was renamed: set '{new_name}'{in_unit} instead")
        self.name, self.value, self.allowed, self.hint = name, value, f"named '{new_name}'", ""


class UnknownParameterError(ParameterError):
    """A parameter that is not declared."""

    def __init__(self, name: str, value: object, known: Iterable[str]) -> None:
        self._known = tuple(sorted(known))
        names = ", ".join(self._known)
        ValueError.__init__(self, f"there is no parameter '{name}': its name must be one of {names}")
        self.name, self.value, self.allowed, self.hint = name, value, f"named one of {names}", ""

    def prefixed(self, prefix: str) -> ParameterError:
        """See ParameterError."""
        return UnknownParameterError(f"{prefix}{self.name}", self.value, [prefix + name for name in self._known])


@dataclass(frozen=True)
class ParameterSpec:
    """Everything about one parameter but its value.

    `kind` is bool, int, float or str, `is_list` is True if the value is a tuple of them. `minimum` and `maximum` are
    inclusive and hold for every element of a list; `choices` lists the allowed strings. `formerly` is the
    full name that the parameter had in an earlier release.
    """

    name: str
    kind: type
    is_list: bool
    default: Any
    description: str
    unit: str
    minimum: float | None
    maximum: float | None
    choices: tuple[str, ...] | None
    read_only: bool
    formerly: str = ""

    @property
    def required(self) -> bool:
        """True if the user must give a value."""
        return self.default is REQUIRED

    @property
    def allowed(self) -> str:
        """What the value must be, in words."""
        noun = {bool: "true or false", int: "a whole number", float: "a number", str: "a text"}[self.kind]
        if self.choices is not None:
            noun = "one of " + ", ".join(repr(choice) for choice in self.choices)
        elif self.minimum is not None and self.maximum is not None:
            noun += f" from {self.minimum:g} to {self.maximum:g}"
        elif self.minimum is not None:
            noun += f" of at least {self.minimum:g}"
        elif self.maximum is not None:
            noun += f" of at most {self.maximum:g}"
        if self.unit:
            noun += f" [{self.unit}]"
        return f"a list, each {noun}" if self.is_list else noun

    def normalised(self, value: Any) -> Any:
        """Return `value` in the parameter's own type (lists as tuples); raise ParameterError if it cannot be."""
        if not self.is_list:
            return self._normalised_element(value, value)
        if isinstance(value, (str, bytes)) or not hasattr(value, "__iter__"):
            raise ParameterError(self.name, value, self.allowed, self._hint(value))
        return tuple(self._normalised_element(element, value) for element in value)

    def _hint(self, value: Any) -> str:
        return spelling_hint(self.kind, self.is_list, self.choices, value)

    def _normalised_element(self, element: Any, whole: Any) -> Any:
        if self.kind is float and isinstance(element, int) and not isinstance(element, bool):
            try:
                element = float(element)
            except OverflowError:
                raise ParameterError(self.name, whole, self.allowed) from None
        if type(element) is not self.kind:  # not isinstance: True is no whole number
            raise ParameterError(self.name, whole, self.allowed, "" if self.is_list else self._hint(element))
        if isinstance(element, float) and not math.isfinite(element):
            raise ParameterError(self.name, whole, self.allowed)
        if self.choices is not None and element not in self.choices:
            raise ParameterError(self.name, whole, self.allowed)
        if isinstance(element, (int, float)):
            low, high = self.minimum, self.maximum
            if (low is not None and element < low) or (high is not None and element > high):
                raise ParameterError(self.name, whole, self.allowed)
        return element


def parameter(
    default: Any,
    description: str,
    *,
    unit: str = "",
    minimum: float | None = None,
    maximum: float | None = None,
    choices: tuple[str, ...] | Callable[[], tuple[str, ...]] | None = None,
    read_only: bool = False,
    formerly: str = "",
) -> Any:
    """Return a dataclass field that carries a parameter's description; see the module's docstring.

    `choices` may be a function, called at each validation: the names of a registry that others may add to.
    """
    metadata = {
        _KEY: {
            "description": description,
            "unit": unit,
            "minimum": minimum,
            "maximum": maximum,
            "choices": choices,
            "read_only": read_only,
            "formerly": formerly,
        }
    }
    return dataclasses.field(default=default, metadata=metadata)


Self = TypeVar("Self", bound="Parameters")


@dataclass(frozen=True)
class Parameters:
    """A validated set of parameters. Subclasses are frozen dataclasses whose fields are made by `parameter`."""

    def __post_init__(self) -> None:
        for spec in self.specs():
            value = getattr(self, spec.name)
            if value is REQUIRED:
                raise ParameterError(spec.name, None, f"given ({spec.allowed})")
            object.__setattr__(self, spec.name, spec.normalised(value))
        self.check()

    def check(self) -> None:
        """Raise ParameterError where parameters contradict each other; the base checks nothing."""

    @classmethod
    def specs(cls) -> tuple[ParameterSpec, ...]:
        """Return the specification of every field, in order of declaration."""
        hints = typing.get_type_hints(cls)
        specs = []
        for field in dataclasses.fields(cls):
            kind, is_list = hints[field.name], False
            if typing.get_origin(kind) is tuple:
                kind, is_list = typing.get_args(kind)[0], True
            known = dict(field.metadata[_KEY])
            if callable(known["choices"]):
                known["choices"] = known["choices"]()
            specs.append(ParameterSpec(field.name, kind, is_list, field.default, **known))
        return tuple(specs)

    @classmethod
    def from_mapping(cls: type[Self], values: Mapping[str, Any]) -> Self:
        """Build the set from names and values; unknown names raise ParameterError."""
        known = {spec.name for spec in cls.specs()}
        for name, value in values.items():
            if name not in known:
                raise UnknownParameterError(name, value, known)
        return cls(**values)

    def replaced(self: Self, **changes: Any) -> Self:
        """Return a validated copy with some values changed; unknown names raise ParameterError."""
        current = {spec.name: getattr(self, spec.name) for spec in self.specs()}
        return type(self).from_mapping(current | changes)


Groups = tuple[tuple[str, type[Parameters]], ...]
"""An executable's parameter groups: each class with the prefix of its names, such as ("disparity.", ...)."""


def replaced_groups(
    groups: Groups, values: Mapping[str, Any], current: Iterable[Parameters] | None = None
) -> tuple[Parameters, ...]:
    """Return one instance of every group, in their order, with some values changed by their full names.

    `current` are the instances to begin with, those of the defaults if none. Raises ParameterError, with the full name,
    for an unknown name or an invalid value.
    """
    known = {prefix + spec.name for prefix, kind in groups for spec in kind.specs()}
    for name, value in values.items():
        if name not in known:
            raise UnknownParameterError(name, value, known)
    begun = [kind() for _, kind in groups] if current is None else list(current)
    changed = []
    for (prefix, kind), group in zip(groups, begun, strict=True):
        own = {spec.name: values[prefix + spec.name] for spec in kind.specs() if prefix + spec.name in values}
        try:
            changed.append(group.replaced(**own))
        except ParameterError as error:
            raise error.prefixed(prefix) from None
    return tuple(changed)


def renamed(groups: Groups) -> dict[str, tuple[str, ParameterSpec]]:
    """Return the former names of an executable's parameters, each with the new full name and its specification."""
    return {
        spec.formerly: (prefix + spec.name, spec) for prefix, group in groups for spec in group.specs() if spec.formerly
    }
