"""Imports go downwards only: from bench and tools to training, from these to src, and never between bench and tools."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
ABOVE = {
    "src": {"training", "bench", "tools", "test"},
    "training": {"bench", "tools", "test"},
    "bench": {"tools", "test"},
    "tools": {"bench", "test"},
}


def _imported(path: Path) -> set[str]:
    """Return the top-level packages that a file imports."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names.add(node.module.split(".")[0])
    return names


@pytest.mark.parametrize("folder", sorted(ABOVE))
def test_nothing_imports_upwards(folder: str) -> None:
    files = list((ROOT / folder).rglob("*.py"))
    assert files
    upwards = {str(path.relative_to(ROOT)): _imported(path) & ABOVE[folder] for path in files}
    assert {path: names for path, names in upwards.items() if names} == {}
