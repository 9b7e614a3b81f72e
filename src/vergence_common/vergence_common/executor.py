"""The executor on which a node's callbacks run: rclpy's events executor, where it is installed.

SingleThreadedExecutor builds a set of everything that may become ready for every message, in Python; the events
executor is called by what has become ready. `VERGENCE_EXECUTOR=single` chooses the former.
"""

import os

from rclpy.context import Context
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.logging import get_logger
from rclpy.task import Future

VARIABLE = "VERGENCE_EXECUTOR"
_LONGEST_WAIT_S = 1.0


def make_executor(context: Context | None = None) -> Executor:
    """Return an events executor; SingleThreadedExecutor where that is chosen, or rclpy (before 7.1.4) has no other."""
    if os.environ.get(VARIABLE, "events") == "single":
        return SingleThreadedExecutor(context=context)
    try:
        from rclpy.experimental.events_executor import EventsExecutor
    except ImportError as error:
        get_logger("vergence_common").info(f"rclpy has no events executor ({error}): callbacks cost more CPU time")
        return SingleThreadedExecutor(context=context)
    return EventsExecutor(context=context)


def spin(executor: Executor, context: Context) -> None:
    """Run callbacks until the context is shut down.

    A future that never ends gives a time limit to many callbacks at once: `spin_once` returns to Python after each,
    which costs more than many of them. Without a limit, in rclpy 7.1.6 the events executor's own `spin` waits by
    spinning and keeps the interpreter from all other threads.
    """
    try:
        while context.ok():
            executor.spin_until_future_complete(Future(), timeout_sec=_LONGEST_WAIT_S)
    except ExternalShutdownException:
        return
