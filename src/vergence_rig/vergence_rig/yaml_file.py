"""The one way to read a YAML file: kind, size, depth, numbers and keys are checked, and every fault is one line."""

import os
import stat
from collections.abc import Hashable
from pathlib import Path
from typing import Any

import yaml

LARGEST_BYTES = 1_000_000
DEEPEST = 20
LONGEST_INTEGER = 20


class YamlFileError(ValueError):
    """A file that cannot be used: the message says why, and does not name the file."""


def read_small_text(path: str | Path) -> str:
    """Return the text of a regular file of at most LARGEST_BYTES. Raises YamlFileError; never waits for a pipe."""
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    except (OSError, ValueError) as error:
        raise YamlFileError(f"cannot be read: {getattr(error, 'strerror', None) or error}") from error
    try:
        found = os.fstat(descriptor)
        if stat.S_ISDIR(found.st_mode):
            raise YamlFileError("cannot be read: Is a directory")
        if not stat.S_ISREG(found.st_mode):
            raise YamlFileError("cannot be read: it must be a regular file, no pipe, socket or device")
        if found.st_size > LARGEST_BYTES:
            raise YamlFileError(f"cannot be read: it must have at most {LARGEST_BYTES} bytes: got {found.st_size}")
        with os.fdopen(descriptor, "rb", closefd=False) as file:
            data = file.read(LARGEST_BYTES + 1)
    finally:
        os.close(descriptor)
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        raise YamlFileError(f"is not YAML: it must be text in UTF-8 ({error.reason} at byte {error.start})") from error


def read_yaml(path: str | Path) -> Any:
    """Return the document in a YAML file. Raises YamlFileError."""
    return parse_yaml(read_small_text(path))


def parse_yaml(text: str) -> Any:
    """Return the document in a text of YAML. Raises YamlFileError."""
    try:
        return yaml.load(text, _Loader)
    except yaml.YAMLError as error:
        raise YamlFileError(f"is not YAML: {' '.join(str(error).split())}") from error
    except (ValueError, OverflowError, RecursionError) as error:
        raise YamlFileError(f"is not YAML: a value cannot be read: {' '.join(str(error).split())}") from error


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

    def construct_limited_int(self, node: Any) -> int:
        if len(node.value) > LONGEST_INTEGER:
            text = f"a whole number must have at most {LONGEST_INTEGER} digits: got {len(node.value)}"
            raise yaml.MarkedYAMLError(None, None, text, node.start_mark)
        return int(self.construct_yaml_int(node))


_Loader.add_constructor("tag:yaml.org,2002:int", _Loader.construct_limited_int)
