"""Write docs/faults.md from the faults that test/faults injects; a test holds the page equal to them."""

from pathlib import Path

from vergence_bringup.testing.ros.fault_trial import NAMED_WITHIN_S, RECOVERED_WITHIN_S
from vergence_bringup.testing.ros.faults import FAULTS, Fault

PAGE = Path(__file__).resolve().parent.parent / "docs" / "faults.md"

_HEAD = f"""# Faults

What is wrong is named on `/diagnostics` within {NAMED_WITHIN_S:g} s, and no longer {RECOVERED_WITHIN_S:g} s after its
end; meanwhile the eyes are not reported as verged unless they are. This table is made from the faults that
`test/faults` injects into the running graph, by `python tools/write_fault_table.py`. `make bench ONLY=faults` measures
the times, and `make soak` runs goals for an hour. `vergence watch` shows the diagnostics of a running head.

| fault | diagnostic | says | the head |
|---|---|---|---|
"""
_TAIL = """
Every node also reports `clock` while `use_sim_time` is true: an ERROR where no `/clock` arrives. What cannot start at
all (a file, an argument, the environment) is one line and status 2; `vergence doctor` tries what a start needs.
"""


def page() -> str:
    """Return the page's text."""
    return _HEAD + "".join(map(_row, FAULTS)) + _TAIL


def _row(fault: Fault) -> str:
    return f"| {fault.name} | `{fault.source}` | ... {fault.words} ... | {fault.head} |\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
