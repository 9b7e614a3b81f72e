"""What every benchmark shares: its rows, where they are written, and how they are printed."""

import json
import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path

OUT_DIR = Path(__file__).resolve().parent.parent / "out" / "bench"


@dataclass(frozen=True)
class Row:
    """One measured figure beside what a user would use instead.

    `what` is the row's name, `value` and `against_value` are in `unit`; `against` names the peer. NaN means that the
    figure could not be computed and is written as null, like a missing peer.
    """

    what: str
    value: float | None
    unit: str
    against: str | None = None
    against_value: float | None = None


def _finite(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)


def write(name: str, rows: Iterable[Row], out_dir: Path = OUT_DIR) -> Path:
    """Write the rows of benchmark `name` to `<out_dir>/<name>.json` and return that path."""
    out_dir.mkdir(parents=True, exist_ok=True)
    path = out_dir / f"{name}.json"
    records = [asdict(row) | {"value": _finite(row.value), "against_value": _finite(row.against_value)} for row in rows]
    path.write_text(json.dumps(records, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    return path


def table(rows: Iterable[Row]) -> str:
    """Return the rows as a table for the terminal."""
    lines = [("what", "value", "unit", "against", "its value")]
    for row in rows:
        lines.append((row.what, figure_text(row.value), row.unit, row.against or "", figure_text(row.against_value)))
    widths = [max(len(line[i]) for line in lines) for i in range(5)]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip() for line in lines
    )


def figure_text(value: float | None) -> str:
    """Return a figure as the tables show it."""
    if value is None or math.isnan(value):
        return "-"
    return "never" if math.isinf(value) else f"{value:.4g}"
