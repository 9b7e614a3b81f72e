"""Which pairs of a stream are looked at: two in a row, a few times a second."""

from typing import Generic, TypeVar

Item = TypeVar("Item")

_ROW_NS = 500_000_000


class PairChoice(Generic[Item]):
    """Chooses by stamps [ns], so that a slow replay is measured as often as a live stream. For one thread."""

    def __init__(self, rate_hz: float) -> None:
        self.rate_hz = rate_hz
        self._due_ns: int | None = None
        self._first: tuple[int, Item] | None = None

    def wants(self, stamp_ns: int) -> bool:
        """Tell whether a pair with this stamp is worth decoding. A clock that was set back begins anew."""
        period_ns = round(1e9 / self.rate_hz)
        if self._due_ns is None or stamp_ns < self._due_ns - 2 * period_ns:
            self._due_ns, self._first = stamp_ns, None
        return stamp_ns >= self._due_ns

    def take(self, stamp_ns: int, item: Item) -> tuple[Item, Item] | None:
        """Take a wanted pair; return it with the one just before it, or None if it is the first of a row."""
        first, self._first = self._first, (stamp_ns, item)
        if first is None or not 0 < stamp_ns - first[0] <= _ROW_NS:
            return None
        # From the first of the row: two periods of the cameras must not add to that of the measurements.
        self._due_ns, self._first = first[0] + round(1e9 / self.rate_hz), None
        return first[1], item
