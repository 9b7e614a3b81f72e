"""Parameter sets validate themselves and name the parameter, the value and what is allowed."""

import dataclasses
import math
from dataclasses import dataclass

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vergence_rig.parameters import REQUIRED, ParameterError, Parameters, UnknownParameterError, parameter


@dataclass(frozen=True)
class Example(Parameters):
    gain: float = parameter(1.0, "how strong", unit="1/s", minimum=0.0, maximum=5.0)
    count: int = parameter(3, "how many", minimum=1)
    windows_px: tuple[int, ...] = parameter((50, 100), "windows", unit="px", minimum=8, maximum=4096)
    mode: str = parameter("left", "which", choices=("left", "right"))
    on: bool = parameter(True, "whether")

    def check(self):
        if self.count > 10 and not self.on:
            raise ParameterError("count", self.count, "at most 10 while off")


@dataclass(frozen=True)
class Needy(Parameters):
    device: str = parameter(REQUIRED, "which camera")


def test_defaults_hold():
    assert Example() == Example(1.0, 3, (50, 100), "left", True)


def test_a_whole_number_is_good_for_a_float():
    gain = Example(gain=2).gain
    assert gain == 2.0
    assert type(gain) is float


def test_a_list_becomes_a_tuple():
    assert Example.from_mapping({"windows_px": [64, 128]}).windows_px == (64, 128)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("gain", -0.1),
        ("gain", 5.1),
        ("gain", math.nan),
        ("gain", math.inf),
        ("gain", "1"),
        ("gain", True),
        ("count", 0),
        ("count", 2.0),
        ("count", True),
        ("windows_px", (50, 4)),
        ("windows_px", 50),
        ("windows_px", "50"),
        ("windows_px", (50, 60.5)),
        ("mode", "up"),
        ("mode", 1),
        ("on", 1),
        ("on", "true"),
    ],
)
def test_what_is_not_allowed_is_named(name, value):
    with pytest.raises(ParameterError) as raised:
        Example(**{name: value})
    assert raised.value.name == name
    text = str(raised.value)
    assert f"'{name}'" in text
    assert repr(value) in text
    assert "must be" in text


def test_cross_checks_run_at_every_change():
    with pytest.raises(ParameterError, match="at most 10"):
        Example(count=11, on=False)
    with pytest.raises(ParameterError, match="at most 10"):
        Example(count=11).replaced(on=False)


def test_unknown_names_are_refused_and_the_known_listed():
    with pytest.raises(UnknownParameterError, match=r"'gian'.*gain"):
        Example.from_mapping({"gian": 1.0})
    with pytest.raises(UnknownParameterError):
        Example().replaced(gian=1.0)


def test_a_required_parameter_must_be_given():
    with pytest.raises(ParameterError, match=r"device.*must be given"):
        Needy()
    assert Needy(device="/dev/video0").device == "/dev/video0"


def test_a_set_cannot_be_changed_in_place():
    with pytest.raises(dataclasses.FrozenInstanceError):
        Example().gain = 2.0  # type: ignore[misc]


@given(st.floats(0.0, 5.0), st.integers(1, 2**40))
def test_whatever_is_allowed_is_kept(gain, count):
    changed = Example().replaced(gain=gain, count=count)
    assert (changed.gain, changed.count) == (gain, count)
    assert Example() == Example()


def test_specs_carry_the_descriptions():
    spec = next(spec for spec in Example.specs() if spec.name == "windows_px")
    assert (spec.kind, spec.is_list, spec.unit, spec.minimum, spec.default) == (int, True, "px", 8, (50, 100))
    assert spec.allowed == "a list, each a whole number from 8 to 4096 [px]"
