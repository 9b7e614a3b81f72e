"""YAML files as a tired user, an editor or a full disk leaves them: for tests of what reads them."""

from collections.abc import Callable

ODD_VALUES = (
    b"",
    b"~",
    b"true",
    b"off",
    b"Yes",
    b"0",
    b"-1",
    b"7",
    b"1e308",
    b"-1e400",
    b"5e-324",
    b"3e-04",
    b".nan",
    b".inf",
    b"9223372036854775808",
    b"9" * 400,
    b"9" * 5000,
    b"0x7f",
    b"0123",
    b"12:30:15",
    b"2001-99-99",
    b"2020-01-01",
    b"''",
    b'"\\ud800"',
    b"'0'",
    b"text",
    b"x" * 10_000,
    "ä\u2028\u0085ß".encode(),
    b"\xff\xfe\x00",
    b"\x00",
    b"[]",
    b"{}",
    b"[1, 2.5, x, true]",
    b"[[1]]",
    b"{a: {b: 1}}",
    b"[" * 3000 + b"]" * 3000,
    b"{a: " * 300 + b"1" + b"}" * 300,
    b"*nowhere",
    b"&a [*a, *a]",
    b"!!python/object:os.system {}",
    b"!!int x",
    b"!!binary \xc3\xa4",
    b"!!timestamp x",
    b"!!set {a, b}",
    b"| \n  block\n   text",
    b"? complex",
    b"%YAML 9",
    b"a: b: c",
    b"'unfinished",
    b"{",
)

Change = Callable[[list[bytes], int, bytes], list[bytes]]


def _value(lines: list[bytes], at: int, odd: bytes) -> list[bytes]:
    key, separator, _ = lines[at].partition(b":")
    return [*lines[:at], key + separator + b" " + odd, *lines[at + 1 :]]


def _key(lines: list[bytes], at: int, odd: bytes) -> list[bytes]:
    line = lines[at]
    margin = line[: len(line) - len(line.lstrip())]
    return [*lines[:at], margin + odd + b":" + line.partition(b":")[2], *lines[at + 1 :]]


def _twice(lines: list[bytes], at: int, odd: bytes) -> list[bytes]:
    return [*lines[: at + 1], *_value(lines, at, odd)[at:]]


def _deeper(lines: list[bytes], at: int, odd: bytes) -> list[bytes]:
    return [*lines[:at], b"  " + lines[at], *lines[at + 1 :]]


def _shallower(lines: list[bytes], at: int, odd: bytes) -> list[bytes]:
    return [*lines[:at], lines[at].removeprefix(b"  "), *lines[at + 1 :]]


def _tabbed(lines: list[bytes], at: int, odd: bytes) -> list[bytes]:
    return [*lines[:at], lines[at].replace(b"  ", b"\t"), *lines[at + 1 :]]


def _cut(lines: list[bytes], at: int, odd: bytes) -> list[bytes]:
    return [*lines[:at], lines[at][: len(lines[at]) // 2]]


def _without(lines: list[bytes], at: int, odd: bytes) -> list[bytes]:
    return lines[:at] + lines[at + 1 :]


def _between(lines: list[bytes], at: int, odd: bytes) -> list[bytes]:
    return [*lines[:at], odd, *lines[at:]]


def _only(lines: list[bytes], at: int, odd: bytes) -> list[bytes]:
    return [odd]


def _more_documents(lines: list[bytes], at: int, odd: bytes) -> list[bytes]:
    return [*lines[:at], b"---", *lines[at:]]


def _huge(lines: list[bytes], at: int, odd: bytes) -> list[bytes]:
    return [*lines, b"# " + b"x" * 2_000_000]


CHANGES: tuple[Change, ...] = (
    _value,
    _key,
    _twice,
    _deeper,
    _shallower,
    _tabbed,
    _cut,
    _without,
    _between,
    _only,
    _more_documents,
    _huge,
)


def mutated(text: str, change: Change, at: int, odd: bytes) -> bytes:
    """Return a YAML file with one change at its line `at`, counted without comments and around the end."""
    lines = [line.encode() for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    return b"\n".join(change(lines, at % len(lines), odd)) + b"\n"
