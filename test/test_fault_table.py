"""docs/faults.md is what test/faults tries."""

import importlib.util
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def test_the_page_is_up_to_date() -> None:
    spec = importlib.util.spec_from_file_location("fault_table", ROOT / "tools" / "write_fault_table.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert (ROOT / "docs" / "faults.md").read_text(encoding="utf-8") == module.page(), (
        "run: python tools/write_fault_table.py"
    )
