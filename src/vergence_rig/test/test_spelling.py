"""A value that YAML reads as another type is refused with the spelling that works, and that spelling does work."""

import re
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vergence_rig.parameters import ParameterError, ParameterSpec
from vergence_rig.yaml_file import YamlFileError, parse_yaml


def _spec(kind: type, choices: tuple[str, ...] | None = None, is_list: bool = False) -> ParameterSpec:
    return ParameterSpec("lock", kind, is_list, None, "an example", "", None, None, choices, False)


CASES: list[tuple[str, ParameterSpec, object]] = [
    ("off", _spec(str, ("off", "hold")), "off"),
    ("False", _spec(str, ("off", "hold")), "off"),
    ("on", _spec(str, ("on", "off")), "on"),
    ("yes", _spec(str, ("yes", "no")), "yes"),
    ("0", _spec(str), "0"),
    ("12345678", _spec(str), "12345678"),
    ("'3e-04'", _spec(float), 3e-4),
    ("'7'", _spec(int), 7),
    ("7.0", _spec(int), 7),
    ("'True'", _spec(bool), True),
    ("'off'", _spec(bool), False),
    ("3", _spec(int, is_list=True), (3,)),
    ("3", _spec(float, is_list=True), (3.0,)),
    ("x", _spec(str, is_list=True), ("x",)),
]


@pytest.mark.parametrize(("text", "spec", "meant"), CASES, ids=lambda value: str(value)[:20])
def test_the_spelling_that_the_error_shows_is_the_one_that_works(text: str, spec: ParameterSpec, meant: object) -> None:
    with pytest.raises(ParameterError) as refused:
        spec.normalised(parse_yaml(text))
    shown = re.search(
        r"write lock: (.+?)(?: in a file|$)", str(refused.value.prefixed("camera.")).replace("camera.", "")
    )
    assert shown is not None
    assert spec.normalised(parse_yaml(shown[1])) == meant


@pytest.mark.parametrize(
    ("text", "value"), [("3e-04", 3e-4), ("65e-3", 0.065), ("1e5", 1e5), (".5E+1", 5.0), ("2", 2.0), ("-1.e-1", -0.1)]
)
def test_every_usual_spelling_of_a_number_is_a_number(text: str, value: float) -> None:
    assert _spec(float).normalised(parse_yaml(text)) == value


@given(
    st.text(max_size=30),
    st.sampled_from([_spec(kind, is_list=many) for kind in (bool, int, float, str) for many in (False, True)]),
)
def test_whatever_is_written_is_a_value_or_one_error(text: str, spec: ParameterSpec) -> None:
    errors: list[Any] = []
    try:
        spec.normalised(parse_yaml(text))
    except (YamlFileError, ParameterError) as error:
        errors.append(str(error))
    assert all(error and error.isprintable() for error in errors)


@pytest.mark.parametrize(
    ("text", "value"),
    [("0123", "0123"), ("12:30", "12:30"), ("1_000", "1_000"), ("0x10", 16), ("0o17", 15)],
)
def test_what_looks_like_a_serial_number_or_a_time_is_a_text(text: str, value: object) -> None:
    assert parse_yaml(text) == value
