"""The messages of one topic: the newest, its age, and their rate."""

import math
from collections import deque
from dataclasses import dataclass, field
from typing import Any

_RATE_WINDOW_S = 3.0


@dataclass
class Stream:
    """One topic: the newest message, its arrival, and the arrivals of the last seconds (monotonic s)."""

    message: Any = None
    arrived_s: float = -math.inf
    count: int = 0
    _arrivals_s: deque[float] = field(default_factory=lambda: deque(maxlen=512))

    def add(self, message: Any, now_s: float) -> None:
        """Store a message that arrived at `now_s`."""
        self.message, self.arrived_s = message, now_s
        self.count += 1
        self._arrivals_s.append(now_s)

    def rate_hz(self, now_s: float) -> float:
        """Return the rate of messages over the last 3 s; 0 if there were none."""
        while self._arrivals_s and now_s - self._arrivals_s[0] > _RATE_WINDOW_S:
            self._arrivals_s.popleft()
        if len(self._arrivals_s) < 2:
            return 0.0
        return (len(self._arrivals_s) - 1) / max(self._arrivals_s[-1] - self._arrivals_s[0], 1e-9)
