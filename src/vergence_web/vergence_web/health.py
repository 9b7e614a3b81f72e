"""The newest entry of each name on /diagnostics, as the page lists them."""

from collections.abc import Mapping
from typing import Any

from vergence_rig.report import STALE

_GONE_S = 3.0
_MOST_NAMES = 300
_LONGEST, _MOST_VALUES = 300, 40


class Health:
    """Entries by name. What came from outside is bounded in number and length."""

    def __init__(self) -> None:
        self._entries: dict[str, tuple[int, str, Mapping[str, str], float]] = {}

    def add(self, name: str, level: int, message: str, values: Mapping[str, str], now_s: float) -> None:
        """Store an entry that arrived at `now_s` (monotonic)."""
        if name in self._entries or len(self._entries) < _MOST_NAMES:
            self._entries[name] = (level, message, values, now_s)

    def as_values(self, now_s: float) -> list[dict[str, Any]]:
        """Return all entries, the worst first; one whose node is silent is STALE."""
        listed = []
        for name, (level, message, values, arrived_s) in self._entries.items():
            gone = now_s - arrived_s > _GONE_S
            shown = dict(list(values.items())[:_MOST_VALUES])
            listed.append(
                {
                    "name": name[:_LONGEST],
                    "level": STALE if gone else level,
                    "message": f"silent for {now_s - arrived_s:.0f} s" if gone else message[:_LONGEST],
                    "values": {key[:_LONGEST]: value[:_LONGEST] for key, value in shown.items()},
                }
            )
        return sorted(listed, key=lambda entry: (-entry["level"], entry["name"]))
