"""Persons: detectors' layouts, whose face is whose, which person is chosen, where a gaze rests, how they are found."""

from collections.abc import Callable

from bench import people_attention, people_choice, people_layouts, people_pairs, people_point
from bench.results import Row, table

__all__ = ["run", "table"]


def run(say: Callable[[str], None]) -> list[Row]:
    """Run all parts."""
    return [
        *people_layouts.rows(say),
        *people_pairs.rows(say),
        *people_choice.rows(say),
        *people_point.rows(say),
        *people_attention.rows(say),
    ]
