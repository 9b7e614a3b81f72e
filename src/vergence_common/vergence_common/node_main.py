"""The one way in which every node starts, spins and ends."""

import contextlib
import os
import pwd
import signal
import sys
import tempfile
import threading
from collections.abc import Callable, Sequence
from pathlib import Path

import rclpy
from rclpy.node import Node

from vergence_common.blas_threads import limit_blas_threads
from vergence_common.executor import make_executor, spin
from vergence_common.memory import keep_large_blocks

STATUS_BAD_INPUT = 2


class StartAbandonedError(Exception):
    """Raised while a node is made and asked to end, by one whose own thread cannot stop what it is doing at once."""


def run_node(make_node: Callable[[], Node], args: Sequence[str] | None = None) -> int:
    """Make a node and run it to its end; see `run_nodes`."""
    return run_nodes([make_node], args)


def run_nodes(makers: Sequence[Callable[[], Node]], args: Sequence[str] | None = None) -> int:
    """Make nodes in this order, spin them on one thread until SIGINT, SIGTERM or shutdown, and close them.

    A node's own `close()`, where it has one, releases hardware and joins its threads. A ValueError while the node
    is made (a wrong parameter, rig or calibration) is one line on standard error and status 2; so is a parameter file
    that cannot be read. A clean end is status 0, also of a node that ends while it is being made. They are closed in
    the order in which they were made: the sources first.
    """
    keep_large_blocks()
    limit_blas_threads()
    _ensure_home()
    stop_asked = threading.Event()
    # Under rclpy's own handlers, which shut the context down, Python's would also raise KeyboardInterrupt in the middle
    # of whatever runs, a message's conversion or a servo's release.
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop_asked.set())
    try:
        rclpy.init(args=list(args) if args is not None else None)
    except Exception as error:
        return _bad_input(error)
    nodes: list[Node] = []
    try:
        if stop_asked.is_set():
            return 0
        # The executor is made first: after a shutdown its constructor would log an error.
        executor = make_executor()
        for make_node in makers:
            if stop_asked.is_set():
                return 0
            nodes.append(make_node())
            executor.add_node(nodes[-1])
        spin(executor, rclpy.get_default_context())
    except StartAbandonedError:
        # Its thread holds no hardware; waiting for it, or tearing the interpreter down beside it, would be wrong.
        rclpy.try_shutdown()
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(0)
    except Exception as error:
        if stop_asked.is_set() or not rclpy.ok():
            return 0  # the context was shut down meanwhile: the failure is its consequence
        if len(nodes) < len(makers) and isinstance(error, (ValueError, OSError)):
            return _bad_input(error)
        raise
    finally:
        _close(nodes)
    return 0


def _ensure_home() -> None:
    """Give the logs of ROS a folder where HOME is not set, as in a service of the system."""
    if any(os.environ.get(name) for name in ("HOME", "ROS_HOME", "ROS_LOG_DIR")):
        return
    try:
        os.environ["HOME"] = pwd.getpwuid(os.getuid()).pw_dir
    except KeyError:  # a user without an entry
        os.environ["ROS_HOME"] = tempfile.gettempdir()


def _bad_input(error: Exception) -> int:
    text = " ".join(str(error).split()) or type(error).__name__
    print(f"{Path(sys.argv[0]).stem}: {text}", file=sys.stderr, flush=True)
    return STATUS_BAD_INPUT


def _close(nodes: Sequence[Node]) -> None:
    # A second Ctrl-C must not leave hardware half released.
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    with contextlib.ExitStack() as closing:
        # A stack ends with what was put on it first; whatever fails, the others are closed too.
        closing.callback(rclpy.try_shutdown)
        for node in reversed(nodes):
            closing.callback(node.destroy_node)
            close = getattr(node, "close", None)
            if close is not None:
                closing.callback(close)
