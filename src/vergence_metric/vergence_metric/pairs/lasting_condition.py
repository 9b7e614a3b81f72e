"""A condition that counts once it has held in several pairs for a while."""

import math
from dataclasses import dataclass

PERSISTS_S = 0.5
LEAST_PAIRS = 3


@dataclass(slots=True)
class LastingCondition:
    """Counts the pairs in a row in which something holds."""

    since_s: float = math.nan
    pairs: int = 0

    def update(self, holds: bool, stamp_s: float) -> bool:
        """Add a pair; return whether the condition has held in LEAST_PAIRS and for PERSISTS_S."""
        if not holds:
            self.since_s, self.pairs = math.nan, 0
            return False
        self.pairs += 1
        if self.pairs == 1:
            self.since_s = stamp_s
        return self.pairs >= LEAST_PAIRS and stamp_s - self.since_s >= PERSISTS_S
