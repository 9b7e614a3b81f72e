"""A thread that processes the newest item only; older items are dropped and counted."""

import os
import threading
import time
from collections import deque
from collections.abc import Callable
from queue import SimpleQueue
from typing import Generic, TypeVar

Item = TypeVar("Item")

_HAND_OVER_S = 0.0002


class LatestWorker(Generic[Item]):
    """Runs `work(item)` for the newest item submitted, one at a time, on a thread of its own.

    `submit` is for one thread, never waits for `work` and uses no lock that `work` could hold. An exception of `work`
    is passed to `on_error`, and the thread goes on with the next item. `niceness` (0 to 19, see nice(2)) is added to
    the process's own for this thread.
    """

    def __init__(
        self, work: Callable[[Item], None], on_error: Callable[[Exception], None], name: str, niceness: int = 0
    ) -> None:
        self._work = work
        self._niceness = niceness
        self._on_error = on_error
        self._newest: deque[Item] = deque(maxlen=1)
        self._wake: SimpleQueue[bool] = SimpleQueue()
        self._submitted = 0
        self._started = 0
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def submit(self, item: Item) -> None:
        """Process `item` next, in place of one that is still waiting."""
        self._submitted += 1
        self._newest.append(item)
        self._wake.put(True)
        # Without this the submitter keeps the interpreter for another 0.4 ms, and the worker starts that much later.
        time.sleep(_HAND_OVER_S)

    @property
    def worked(self) -> int:
        """Number of items whose processing has started."""
        return self._started

    @property
    def dropped(self) -> int:
        """Number of items that a newer one replaced before their processing started."""
        return max(self._submitted - self._started - len(self._newest), 0)

    @property
    def alive(self) -> bool:
        """True until the thread has ended."""
        return self._thread.is_alive()

    def close(self, timeout_s: float = 5.0) -> None:
        """Finish the current item and end the thread; idempotent."""
        self._newest.clear()
        self._wake.put(False)
        self._thread.join(timeout_s)

    def _run(self) -> None:
        if self._niceness:
            # On Linux a priority is a thread's own: the node's other threads still receive images at once.
            os.setpriority(os.PRIO_PROCESS, 0, min(os.getpriority(os.PRIO_PROCESS, 0) + self._niceness, 19))
        while self._wake.get():
            try:
                item = self._newest.popleft()
            except IndexError:
                continue
            self._started += 1
            try:
                self._work(item)
            except Exception as error:
                self._on_error(error)
            del item  # two images: free them before the next pair
