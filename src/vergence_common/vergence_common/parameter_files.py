"""Parameter files of ROS: checked by the one reader of YAML, and handed to rcl in a form that it cannot misread.

rcl waits for a pipe, ends with two lines or none, and ignores a file that names another node.
"""

import atexit
import difflib
import json
import math
import os
import re
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ament_index_python.packages import get_packages_with_prefixes

from vergence_common.arguments import remaps
from vergence_rig.parameters import shown
from vergence_rig.yaml_file import YamlFileError, read_yaml

OPTION = "--params-file"

_PARAMETERS = "ros__parameters"
_FORM = "NODE: ros__parameters: NAME: VALUE, with '/**' for any node"
_INT64 = 2**63
_ANY = "/**"


class ParameterFileError(ValueError):
    """A parameter file that cannot be used: the message names the file, the key, what must hold, and the value."""


@dataclass(frozen=True)
class Section:
    """The parameters, by full name, of the nodes whose full name a pattern of rcl matches."""

    pattern: str
    values: Mapping[str, Any]

    def matches(self, node: str) -> bool:
        """Return whether a node of this full name takes the parameters."""
        text = re.escape(self.pattern).replace(r"/\*\*", "(/[^/]+)*").replace(r"\*", "[^/]+")
        # '/**/name' is name in any namespace, the root too; '/**' alone is any node.
        return re.fullmatch(text, node) is not None


def with_checked_files(arguments: Sequence[str], nodes: Sequence[str]) -> list[str]:
    """Return the arguments with every parameter file replaced by a checked copy of it.

    Args:
        arguments: of the command line.
        nodes: full names of the nodes that read them.

    Raises:
        ParameterFileError: a file that cannot be read, is no parameter file, or has nothing for any of the nodes while
            it names one that is not installed.
    """
    checked = list(arguments)
    for i, argument in enumerate(checked[:-1]):
        if argument == OPTION:
            sections = read_parameter_file(checked[i + 1])
            _check_names(checked[i + 1], sections, nodes)
            checked[i + 1] = _copy(sections)
    return checked


def node_name(default: str, arguments: Sequence[str]) -> str:
    """Return the full name of a node that has the name `default` unless the arguments give another."""
    rules = {source.rpartition(":")[2]: target for source, target in remaps(arguments)}
    name = rules.get("__node", rules.get("__name", default))
    namespace = rules.get("__ns", "").strip("/")
    return f"/{namespace}/{name}" if namespace else f"/{name}"


def read_parameter_file(path: str | Path) -> list[Section]:
    """Return the sections of a parameter file. Raises ParameterFileError."""
    try:
        document = read_yaml(path)
    except YamlFileError as error:
        raise ParameterFileError(f"parameter file '{path}' {error}") from error
    try:
        sections = list(_sections("", document))
    except ParameterFileError as error:
        raise ParameterFileError(f"parameter file '{path}': {error}") from error
    return sections


def _sections(place: str, value: Any) -> Iterator[Section]:
    if not isinstance(value, Mapping) or not value:
        where = f"'{place}'" if place else "the file"
        raise ParameterFileError(f"{where} must have the form {_FORM}: got {shown(value)}")
    if _PARAMETERS in value:
        others = [name for name in value if name != _PARAMETERS]
        if others or not place:
            got = shown(others[0]) if others else "no NODE"
            raise ParameterFileError(f"'{_PARAMETERS}' must stand alone below the name of a node: got {got}")
        values = value[_PARAMETERS]
        yield Section(place, dict(_values("", {} if values is None else values)))
        return
    for name, below in value.items():
        if not isinstance(name, str) or not name.strip("/"):
            raise ParameterFileError(f"the name of a node must be a text, as in {_FORM}: got {shown(name)}")
        yield from _sections(f"{place}/{name.strip('/')}", below)


def _values(prefix: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Yield (full name, value) of every parameter."""
    if not isinstance(value, Mapping):
        raise ParameterFileError(
            f"'{prefix.rstrip('.') or _PARAMETERS}' must be a mapping of parameters: got {shown(value)}"
        )
    seen: set[str] = set()
    for name, below in value.items():
        if not isinstance(name, str) or not name:
            raise ParameterFileError(f"the name of a parameter must be a text: got {shown(name)}")
        found = _values(f"{prefix}{name}.", below) if isinstance(below, Mapping) else [(prefix + name, below)]
        for full_name, leaf in found:
            if full_name in seen:
                raise ParameterFileError(f"parameter '{full_name}' must stand once: it stands twice")
            seen.add(full_name)
            yield full_name, _checked(full_name, leaf)


def _checked(name: str, value: Any) -> Any:
    """Return a value that rcl has a type for."""
    if not isinstance(value, list):
        if type(value) not in (bool, int, float, str) or (type(value) is int and not -_INT64 <= value < _INT64):
            hint = "; an empty text is ''" if value is None else ""
            raise ParameterFileError(
                f"parameter '{name}' must be true or false, a number of 64 bits, a text, or a list of one of them: "
                f"got {shown(value)}{hint}"
            )
        if isinstance(value, float) and 0 < abs(value) < sys.float_info.min:
            raise ParameterFileError(f"parameter '{name}' must be 0 or at least {sys.float_info.min:g}: got {value:g}")
        return value
    elements: list[Any] = [e if isinstance(e, list) else _checked(name, e) for e in value]
    kinds = {type(element) for element in elements}
    if kinds == {int, float}:
        return [float(element) for element in elements]
    if len(kinds) > 1 or list in kinds:
        raise ParameterFileError(f"parameter '{name}' must be a list of values of one type: got {shown(value)}")
    return elements


def _check_names(path: str, sections: Sequence[Section], nodes: Sequence[str]) -> None:
    if not nodes or any(section.matches(node) for section in sections for node in nodes):
        return
    installed = _installed()
    strangers = [section.pattern for section in sections if section.pattern.rpartition("/")[2] not in installed]
    own = {node.rpartition("/")[2] for node in nodes}
    # A name without a namespace means the root's to rcl, and rarely to whoever wrote it.
    strangers += [section.pattern for section in sections if section.pattern.removeprefix("/") in own]
    if not strangers:
        return  # a file of several nodes, without parameters of this one
    close = difflib.get_close_matches(strangers[0].rpartition("/")[2], own, n=1) or sorted(own)
    raise ParameterFileError(
        f"parameter file '{path}' must have parameters for {', '.join(nodes)}: it has them for "
        f"{', '.join(section.pattern for section in sections)}; write '/**/{close[0]}:' or '{_ANY}:'"
    )


def _installed() -> set[str]:
    """Return the names of the executables of this workspace's packages."""
    names: set[str] = set()
    for package, prefix in get_packages_with_prefixes().items():
        folder = Path(prefix) / "lib" / package
        if package.startswith("vergence_") and folder.is_dir():
            names |= set(os.listdir(folder))
    return names


def _copy(sections: Sequence[Section]) -> str:
    """Write the sections as JSON, which is YAML in which no value can be taken for another type."""
    lines = [f'{_json(section.pattern)}: {{"{_PARAMETERS}": {_json(section.values)}}}' for section in sections]
    handle, path = tempfile.mkstemp(prefix="vergence_parameters_", suffix=".yaml")
    with os.fdopen(handle, "w", encoding="utf-8") as file:
        file.write("{" + ",\n".join(lines) + "}\n")
    # rcl reads it while the context or the node is made; a node of a host is made late.
    atexit.register(Path(path).unlink, missing_ok=True)
    return path


def _json(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_json(name)}: {_json(below)}" for name, below in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_json, value)) + "]"
    if isinstance(value, float) and not math.isfinite(value):
        return ".nan" if math.isnan(value) else (".inf" if value > 0 else "-.inf")
    if isinstance(value, float):
        text = repr(value)
        return text if "." in text else text.replace("e", ".0e")
    if isinstance(value, str):
        return '"' + "".join(map(_escaped, value)) + '"'
    return json.dumps(value)


def _escaped(character: str) -> str:
    if character in '"\\':
        return f"\\{character}"
    if " " <= character <= "~":
        return character
    return f"\\u{ord(character):04x}" if ord(character) < 0x10000 else f"\\U{ord(character):08x}"
