"""Parameter files: whom their sections are for, what rcl makes of the checked copy, and what is refused."""

import json
from pathlib import Path

import pytest
import rclpy
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rclpy.context import Context
from rclpy.node import Node

from vergence_common.parameter_files import (
    ParameterFileError,
    Section,
    node_name,
    read_parameter_file,
    with_checked_files,
)


@pytest.mark.parametrize(
    ("pattern", "node", "matches"),
    [
        ("/**", "/servo_node", True),
        ("/**", "/head/left/servo_node", True),
        ("/*", "/servo_node", True),
        ("/*", "/head/servo_node", False),
        ("/servo_node", "/servo_node", True),
        ("/servo_node", "/head/servo_node", False),
        ("/**/servo_node", "/head/servo_node", True),
        ("/**/servo_node", "/servo_node", True),
        ("/head/*", "/head/servo_node", True),
        ("/servo", "/servo_node", False),
    ],
)
def test_a_section_is_for_the_nodes_that_rcl_gives_it_to(pattern: str, node: str, matches: bool) -> None:
    assert Section(pattern, {}).matches(node) is matches


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        ([], "/servo_node"),
        (["--ros-args", "-r", "__ns:=/head"], "/head/servo_node"),
        (["--ros-args", "-r", "__node:=arm", "-r", "__ns:=/a/b"], "/a/b/arm"),
        (["--ros-args", "--remap", "servo_node:__node:=arm"], "/arm"),
    ],
)
def test_the_full_name_of_a_node(arguments: list[str], name: str) -> None:
    assert node_name("servo_node", arguments) == name


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "must have the form NODE: ros__parameters"),
        ("5", "must have the form NODE"),
        ("ros__parameters: {a: 1}", "must stand alone below the name of a node"),
        ("/**: {ros__parameters: {a: 1}, b: 2}", "must stand alone"),
        ("/**: {a: 1}", "'/\\*\\*/a' must have the form NODE"),
        ("5: {ros__parameters: {a: 1}}", "the name of a node must be a text"),
        ("/**: {ros__parameters: [1]}", "must be a mapping of parameters"),
        ("/**: {ros__parameters: {5: 1}}", "the name of a parameter must be a text"),
        ("/**: {ros__parameters: {a: }}", "parameter 'a' must be .*an empty text is ''"),
        ("/**: {ros__parameters: {a: [1, x]}}", "'a' must be a list of values of one type"),
        ("/**: {ros__parameters: {a: [[1]]}}", "'a' must be a list of values of one type"),
        ("/**: {ros__parameters: {a: 9223372036854775808}}", "a number of 64 bits"),
        ("/**: {ros__parameters: {a: 5.0e-324}}", "parameter 'a' must be 0 or at least 2.22507e-308"),
        ("/**: {ros__parameters: {a: {b: 1}, a.b: 2}}", r"parameter 'a\.b' must stand once"),
        ("edge: {ros__parameters: {a: 1}}", "it has them for /edge; write '/\\*\\*/servo_node:'"),
        ("servo_nod: {ros__parameters: {a: 1}}", "it has them for /servo_nod"),
    ],
)
def test_what_is_no_file_for_this_node(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "f.yaml").write_text(text)
    with pytest.raises(ParameterFileError, match=words):
        with_checked_files(["--ros-args", "--params-file", str(tmp_path / "f.yaml")], ["/servo_node"])


def test_a_name_without_its_namespace_is_named_with_what_works(tmp_path: Path) -> None:
    (tmp_path / "f.yaml").write_text("servo_node: {ros__parameters: {a: 1}}")
    with pytest.raises(ParameterFileError, match=r"for /head/servo_node: .* write '/\*\*/servo_node:'"):
        with_checked_files(["--params-file", str(tmp_path / "f.yaml")], ["/head/servo_node"])
    (tmp_path / "f.yaml").write_text("/**/servo_node: {ros__parameters: {a: 1}}")
    assert with_checked_files(["--params-file", str(tmp_path / "f.yaml")], ["/head/servo_node"])


def test_a_file_of_several_nodes_need_have_nothing_for_this_one(tmp_path: Path) -> None:
    (tmp_path / "f.yaml").write_text("/left/servo_node: {ros__parameters: {a: 1}}")
    assert with_checked_files(["--params-file", str(tmp_path / "f.yaml")], ["/right/servo_node"])


def test_sections_may_be_nested_by_namespace(tmp_path: Path) -> None:
    (tmp_path / "f.yaml").write_text("head:\n  left:\n    camera_node: {ros__parameters: {a: 1}}\n")
    assert [section.pattern for section in read_parameter_file(tmp_path / "f.yaml")] == ["/head/left/camera_node"]


_SCALARS = st.booleans() | st.integers(-(2**63), 2**63 - 1) | st.floats(allow_nan=False, allow_subnormal=False)
_TEXTS = st.text(st.characters(exclude_categories=["Cs", "Cc", "Cn"], exclude_characters="\ufeff"), max_size=20)


@settings(deadline=None, max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    value=_SCALARS
    | _TEXTS
    | st.lists(st.integers(-(2**63), 2**63 - 1), min_size=1, max_size=4)
    | st.lists(_TEXTS, min_size=1)
)
def test_rcl_reads_the_value_that_was_written(value: object, tmp_path: Path) -> None:
    (tmp_path / "f.yaml").write_text(
        json.dumps({"/**": {"ros__parameters": {"a": {"b": value}}}}, ensure_ascii=False).replace("Infinity", ".inf"),
        encoding="utf-8",
    )
    read = read_parameter_file(tmp_path / "f.yaml")[0].values["a.b"]
    context = Context()
    rclpy.init(args=[], context=context)
    try:
        arguments = with_checked_files(["--ros-args", "--params-file", str(tmp_path / "f.yaml")], [])
        node = Node("n", context=context, cli_args=arguments, enable_rosout=False, start_parameter_services=False)
        found = node._parameter_overrides["a.b"].value
        node.destroy_node()
    finally:
        context.try_shutdown()
    assert (list(found) if isinstance(value, list) else found) == read
    assert type(found) is type(read) or isinstance(value, list)
