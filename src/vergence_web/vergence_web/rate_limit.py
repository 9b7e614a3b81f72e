"""How often something may happen: a token bucket, and one for each remote address."""

from collections import OrderedDict

_MOST_ADDRESSES = 1024


class RateLimit:
    """Allows `rate_hz` a second on average and `burst` at once; by a clock of the caller's."""

    def __init__(self, rate_hz: float, burst: float) -> None:
        self.rate_hz, self.burst = rate_hz, burst
        self._left = burst
        self._at_s: float | None = None

    def allows(self, now_s: float) -> bool:
        """Count one event at `now_s` (monotonic) and return whether it is within the limit."""
        if not self.is_open(now_s):
            return False
        self._left -= 1.0
        return True

    def is_open(self, now_s: float) -> bool:
        """Return whether an event at `now_s` would be within the limit, without counting one."""
        elapsed_s = 0.0 if self._at_s is None else max(0.0, now_s - self._at_s)
        self._at_s = now_s
        self._left = min(self.burst, self._left + elapsed_s * self.rate_hz)
        return self._left >= 1.0


class FailureLimit:
    """Refuses an address that has failed too often: a token must not be found by trying.

    Only the newest 1024 addresses are remembered, so that many of them cannot fill the memory.
    """

    def __init__(self, rate_hz: float, burst: float) -> None:
        self._rate_hz, self._burst = rate_hz, burst
        self._limits: OrderedDict[str, RateLimit] = OrderedDict()

    def may_try(self, address: str, now_s: float) -> bool:
        """Return whether an address may try now."""
        limit = self._limits.get(address)
        return limit is None or limit.is_open(now_s)

    def failed(self, address: str, now_s: float) -> None:
        """Count a failure of an address."""
        limit = self._limits.setdefault(address, RateLimit(self._rate_hz, self._burst))
        self._limits.move_to_end(address)
        limit.allows(now_s)
        while len(self._limits) > _MOST_ADDRESSES:
            self._limits.popitem(last=False)
