"""One thread that works on the newest item only: what it could not reach in time is dropped and counted."""

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

    `submit` is for one thread, never waits for `work` and takes no lock that `work` could hold. An exception of `work`
    goes to `on_error` and the next item is worked on. Threads of all processes that wait for a core go before this one
    by `niceness`, as `nice` means it, beside the process's own.
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
        self._taken = 0
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def submit(self, item: Item) -> None:
        """Let `item` be worked on next, in place of one that still waits."""
        self._submitted += 1
        self._newest.append(item)
        self._wake.put(True)
        # Without this the submitter keeps the interpreter for another 0.4 ms, and the worker starts that much later.
        time.sleep(_HAND_OVER_S)

    @property
    def worked(self) -> int:
        """Items that were taken up."""
        return self._taken

    @property
    def dropped(self) -> int:
        """Items that a newer one replaced before they were taken up."""
        return max(self._submitted - self._taken - len(self._newest), 0)

    @property
    def alive(self) -> bool:
        """True until the thread has ended."""
        return self._thread.is_alive()

    def close(self, timeout_s: float = 5.0) -> None:
        """Finish the item at hand and end the thread; idempotent."""
        self._newest.clear()
        self._wake.put(False)
        self._thread.join(timeout_s)

    def _run(self) -> None:
        if self._niceness:
            # Linux knows priorities of threads: the node's other threads go on taking images at once.
            os.setpriority(os.PRIO_PROCESS, 0, min(os.getpriority(os.PRIO_PROCESS, 0) + self._niceness, 19))
        while self._wake.get():
            try:
                item = self._newest.popleft()
            except IndexError:
                continue
            self._taken += 1
            try:
                self._work(item)
            except Exception as error:
                self._on_error(error)
            del item  # two images: not to be kept alive until the next pair
