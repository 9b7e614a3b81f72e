import os
import sys
import threading
from collections.abc import Iterator
from queue import SimpleQueue

import pytest

from vergence_metric.pairs.latest_worker import LatestWorker


class Work:
    """Work that begins and ends when the test says so."""

    def __init__(self) -> None:
        self.done: list[int] = []
        self.errors: list[Exception] = []
        self.begun = threading.Semaphore(0)
        self.go_on = threading.Semaphore(0)
        self.ended = threading.Semaphore(0)
        self.worker = LatestWorker(self.run, self.fail, "test")

    def run(self, item: int) -> None:
        self.begun.release()
        assert self.go_on.acquire(timeout=60.0)
        if item < 0:
            raise ValueError(item)
        self.done.append(item)
        self.ended.release()

    def fail(self, error: Exception) -> None:
        self.errors.append(error)
        self.ended.release()

    def step(self) -> None:
        self.go_on.release()
        assert self.ended.acquire(timeout=60.0)

    def begin(self, item: int) -> None:
        self.worker.submit(item)
        assert self.begun.acquire(timeout=60.0)


@pytest.fixture
def work() -> Iterator[Work]:
    work = Work()
    yield work
    for _ in range(10):
        work.go_on.release()
    work.worker.close()


def test_only_the_newest_of_those_that_wait_is_worked_on(work: Work) -> None:
    work.begin(1)
    for item in (2, 3, 4):
        work.worker.submit(item)
    assert (work.worker.worked, work.worker.dropped) == (1, 2)
    work.step()
    work.step()
    assert work.done == [1, 4]
    assert (work.worker.worked, work.worker.dropped) == (2, 2)


def test_a_failure_is_reported_and_the_next_item_processed(work: Work) -> None:
    work.begin(-5)
    work.step()
    assert [str(error) for error in work.errors] == ["-5"]
    work.begin(6)
    work.step()
    assert work.done == [6]
    assert work.worker.dropped == 0


def test_closing_finishes_the_item_at_hand_and_leaves_the_waiting_one() -> None:
    work = Work()
    work.begin(1)
    work.worker.submit(2)
    closer = threading.Thread(target=work.worker.close)
    closer.start()
    for _ in range(3):
        work.go_on.release()
    closer.join(10.0)
    assert not closer.is_alive()
    work.worker.close()
    assert work.done in ([1], [1, 2])  # 2 is cleared unless it was taken up before the call
    assert not work.worker.alive


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="threads have priorities of their own on Linux only")
def test_nice_work_gives_way_and_the_submitter_does_not() -> None:
    own = os.getpriority(os.PRIO_PROCESS, 0)
    found: SimpleQueue[object] = SimpleQueue()
    worker: LatestWorker[int] = LatestWorker(
        lambda _: found.put(os.getpriority(os.PRIO_PROCESS, 0)), found.put, "test", niceness=7
    )
    try:
        worker.submit(1)
        assert found.get(timeout=60.0) == min(own + 7, 19)
        assert os.getpriority(os.PRIO_PROCESS, 0) == own
    finally:
        worker.close()
