"""Persons: detectors' layouts, whose face is whose, and how well a gaze rests between the eyes."""

from collections.abc import Callable

from bench import people_layouts, people_pairs, people_point
from bench.results import Row, table

__all__ = ["run", "table"]


def run(say: Callable[[str], None]) -> list[Row]:
    """Run all parts."""
    return [
        *people_layouts.rows(say),
        *people_pairs.rows(say),
        *people_point.rows(say),
    ]
