"""Persons: which one of several is chosen, and how attention finds them without a goal."""

from collections.abc import Callable

from bench import people_attention, people_choice
from bench.results import Row, table

__all__ = ["run", "table"]


def run(say: Callable[[str], None]) -> list[Row]:
    """Run all parts."""
    return [*people_choice.rows(say), *people_attention.rows(say)]
