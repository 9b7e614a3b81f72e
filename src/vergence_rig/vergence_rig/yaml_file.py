"""The one way to read a YAML file: kind, size, depth, numbers and keys are checked, and every fault is one line."""

import re
from collections.abc import Hashable
from pathlib import Path
from typing import Any

import yaml

from vergence_rig.printed import printed_line
from vergence_rig.regular_file import FileError, read_regular_file

LARGEST_BYTES = 1_000_000
DEEPEST = 20
LONGEST_INTEGER = 20


class YamlFileError(FileError):
    """A file that cannot be used: the message says why, and does not name the file."""


def read_small_text(path: str | Path) -> str:
    """Return the text of a regular file of at most LARGEST_BYTES. Raises YamlFileError; never waits for a pipe."""
    try:
        return read_regular_file(path, LARGEST_BYTES).decode("utf-8")
    except UnicodeDecodeError as error:
        raise YamlFileError(f"is not YAML: it must be text in UTF-8 ({error.reason} at byte {error.start})") from error
    except FileError as error:
        raise YamlFileError(str(error)) from error


def read_yaml(path: str | Path) -> Any:
    """Return the document in a YAML file. Raises YamlFileError."""
    return parse_yaml(read_small_text(path))


def parse_yaml(text: str) -> Any:
    """Return the document in a text of YAML. Raises YamlFileError."""
    try:
        return yaml.load(text, _Loader)
    except yaml.YAMLError as error:
        raise YamlFileError(f"is not YAML: {printed_line(error)}") from error
    except Exception as error:  # PyYAML lets through what its constructors raise, an AttributeError for a date
        raise YamlFileError(f"is not YAML: a value cannot be read: {printed_line(error)}") from error


class _Loader(yaml.SafeLoader):
    """SafeLoader with limits; a key that a mapping has twice is an error, as the first value would be lost."""

    def __init__(self, stream: str) -> None:
        super().__init__(stream)
        self._depth = 0

    def compose_node(self, parent: Any, index: Any) -> Any:
        self._depth += 1
        if self._depth > DEEPEST:
            mark = self.peek_event().start_mark
            raise yaml.MarkedYAMLError(None, None, f"values must be nested at most {DEEPEST} deep", mark)
        try:
            return super().compose_node(parent, index)
        finally:
            self._depth -= 1

    def construct_mapping(self, node: Any, deep: bool = False) -> dict[Hashable, Any]:
        seen: set[Any] = set()
        for key_node, _ in node.value:
            if key_node.tag == "tag:yaml.org,2002:merge":
                continue
            key = self.construct_object(key_node, deep=True)
            if isinstance(key, Hashable):
                if key in seen:
                    text = f"the key {key!r} must stand once in a mapping"
                    raise yaml.MarkedYAMLError(None, None, text, key_node.start_mark)
                seen.add(key)
        return dict(super().construct_mapping(node, deep=deep))

    def construct_scalar(self, node: Any) -> Any:
        value = super().construct_scalar(node)
        if isinstance(value, str) and any("\ud800" <= character <= "\udfff" for character in value):
            text = "a text must be of Unicode characters: got half a surrogate pair"
            raise yaml.MarkedYAMLError(None, None, text, node.start_mark)
        return value

    def construct_limited_int(self, node: Any) -> int:
        if len(node.value) > LONGEST_INTEGER:
            text = f"a whole number must have at most {LONGEST_INTEGER} digits: got {len(node.value)}"
            raise yaml.MarkedYAMLError(None, None, text, node.start_mark)
        return int(node.value, 10 if node.value.lstrip("-+")[:2].isdigit() else 0)


# Numbers as in YAML 1.2 and in rcl: YAML 1.1 has no 3e-04 without a point, and takes the serial number 0123 for 83,
# and 12:30 for 750.
_LIKE_NUMBERS = frozenset(f"tag:yaml.org,2002:{kind}" for kind in ("int", "float"))
_NUMBERS = {
    "int": r"[-+]?(?:0|[1-9][0-9]*|0x[0-9a-fA-F]+|0o[0-7]+|0b[01]+)\Z",
    "float": r"(?:[-+]?(?:[0-9]+\.[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?|[-+]?[0-9]+[eE][-+]?[0-9]+"
    r"|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN))\Z",
}
_Loader.yaml_implicit_resolvers = {
    first: [(tag, pattern) for tag, pattern in resolvers if tag not in _LIKE_NUMBERS]
    for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
}
for _kind, _pattern in _NUMBERS.items():
    _Loader.add_implicit_resolver(f"tag:yaml.org,2002:{_kind}", re.compile(_pattern), list("-+.0123456789"))
_Loader.add_constructor("tag:yaml.org,2002:int", _Loader.construct_limited_int)
