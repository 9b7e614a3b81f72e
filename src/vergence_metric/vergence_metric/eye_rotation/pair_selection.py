"""Selection of the pairs of a stream that are measured: two successive pairs, a few times a second."""

from typing import Generic, TypeVar

Item = TypeVar("Item")

_MAX_INTERVAL_NS = 500_000_000


class PairSelection(Generic[Item]):
    """Selects by stamps [ns], so that a slow replay is measured as often as a live stream. For one thread."""

    def __init__(self, rate_hz: float) -> None:
        self.rate_hz = rate_hz
        self._due_ns: int | None = None
        self._first: tuple[int, Item] | None = None

    def is_due(self, stamp_ns: int) -> bool:
        """Return whether a pair with this stamp is to be decoded and added. A clock set back restarts the selection."""
        period_ns = round(1e9 / self.rate_hz)
        if self._due_ns is None or stamp_ns < self._due_ns - 2 * period_ns:
            self._due_ns, self._first = stamp_ns, None
        return stamp_ns >= self._due_ns

    def add(self, stamp_ns: int, item: Item) -> tuple[Item, Item] | None:
        """Add a pair that is due; return it with the one just before it, None for the first of two."""
        first, self._first = self._first, (stamp_ns, item)
        if first is None or not 0 < stamp_ns - first[0] <= _MAX_INTERVAL_NS:
            return None
        # From the first of the two: periods of the cameras must not add to the period of the measurements.
        self._due_ns, self._first = first[0] + round(1e9 / self.rate_hz), None
        return first[1], item
