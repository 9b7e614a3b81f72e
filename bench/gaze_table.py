"""The gaze controller's figures for the terminal: the default's as a list, all settings' as one small matrix each."""

import re
from collections.abc import Iterable

from bench.results import Row, figure_text
from bench.results import table as plain_table

_SETTING = re.compile(r"^(?P<figure>.+)\.(?P<law>[a-z_]+)\.(?P<servo>ideal|sg90|mg995)\.(?P<latency>\d+)$")
_USUAL = ("predictive", "sg90", "60")


def table(rows: Iterable[Row]) -> str:
    """Return all rows as text."""
    usual: list[Row] = []
    cells: dict[str, dict[tuple[str, str, str], Row]] = {}
    for row in rows:
        found = _SETTING.match(row.what)
        if found is None:
            usual.append(row)
        else:
            cells.setdefault(found["figure"], {})[found["law"], found["servo"], found["latency"]] = row
    named = {row.what: row for row in usual}
    for figure, by_setting in cells.items():
        for key, what in [(_USUAL, figure), *(((_USUAL[0], s, _USUAL[2]), f"{figure}.{s}") for s in _servos(cells))]:
            if what in named:
                by_setting.setdefault(key, named[what])
    return "\n".join([plain_table(usual), *(_matrix(figure, by_setting) for figure, by_setting in cells.items())])


def _servos(cells: dict[str, dict[tuple[str, str, str], Row]]) -> list[str]:
    return list(dict.fromkeys(key[1] for by_setting in cells.values() for key in by_setting))


def _matrix(figure: str, by_setting: dict[tuple[str, str, str], Row]) -> str:
    """Return one figure: a line for each law, a column for each servo and latency."""
    laws = dict.fromkeys(key[0] for key in sorted(by_setting, key=lambda key: key[0] != _USUAL[0]))
    heads = sorted({key[1:] for key in by_setting}, key=lambda head: (head[0], int(head[1])))
    unit = next(iter(by_setting.values())).unit
    lines = [f"\n{figure} [{unit}]", " " * 16 + "".join(f"{f'{servo} {ms}':>11}" for servo, ms in heads)]
    for law in laws:
        values = [by_setting.get((law, *head)) for head in heads]
        lines.append(f"  {law:<14}" + "".join(f"{figure_text(row.value) if row else '':>11}" for row in values))
    return "\n".join(lines)
