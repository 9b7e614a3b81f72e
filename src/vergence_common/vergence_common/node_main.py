"""The one way in which every node starts, spins and ends."""

import contextlib
import os
import signal
import sys
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NoReturn

import rclpy
from rclpy.node import Node

from vergence_common.arguments import HELP, check_leftovers, help_text, without_ros
from vergence_common.blas_threads import limit_blas_threads
from vergence_common.executor import make_executor, spin
from vergence_common.memory import keep_large_blocks
from vergence_common.qos import check_overrides
from vergence_common.start import REFUSALS, init, one_line
from vergence_rig.parameters import Groups

STATUS_BAD_INPUT = 2


class StartAbandonedError(Exception):
    """Raised while a node is made and asked to end, by one whose own thread cannot stop what it is doing at once."""


def run_node(make_node: Callable[[], Node], args: Sequence[str] | None = None, groups: Groups = ()) -> int:
    """Make a node and run it to its end; see `run_nodes`. `--help` prints these parameter groups and starts nothing."""
    arguments = sys.argv[1:] if args is None else list(args)
    if any(argument in HELP for argument in without_ros(arguments)):
        print(help_text(_executable(), sys.modules[make_node.__module__].__doc__ or "", groups))
        return 0
    return run_nodes([make_node], arguments, [make_node.__module__.rpartition(".")[2]])


def run_nodes(
    makers: Sequence[Callable[[], Node]], args: Sequence[str] | None = None, names: Sequence[str] = ()
) -> int:
    """Make nodes in this order, spin them on one thread until SIGINT, SIGTERM or shutdown, and close them.

    A node's own `close()`, where it has one, releases hardware and joins its threads. What the user gave and cannot be
    used (an argument, the environment, a parameter, a rig or calibration) is one line on standard error and status 2.
    A clean end is status 0, also of a node that ends while it is being made. They are closed in
    the order in which they were made: the sources first. `names` are their names, unless the arguments give others: a
    parameter file must have something for them.
    """
    arguments = sys.argv[1:] if args is None else list(args)
    keep_large_blocks()
    limit_blas_threads()
    stop_asked = threading.Event()
    # Under rclpy's own handlers, which shut the context down, Python's would also raise KeyboardInterrupt in the middle
    # of whatever runs, a message's conversion or a servo's release.
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop_asked.set())
    try:
        check_leftovers(_executable(), arguments)
        init(arguments, names)
    except Exception as error:
        return _bad_input(error)
    nodes: list[Node] = []
    started = cut_short = False
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
        check_overrides(nodes)
        started = True
        spin(executor, rclpy.get_default_context())
    except StartAbandonedError:
        # Its thread holds no hardware; waiting for it, or tearing the interpreter down beside it, would be wrong.
        rclpy.try_shutdown()
        _leave()
    except Exception as error:
        cut_short = stop_asked.is_set() or not rclpy.ok()
        if cut_short:
            return 0  # the context was shut down meanwhile: the failure is its consequence
        if not started and isinstance(error, REFUSALS):
            return _bad_input(error)
        raise
    finally:
        _close(nodes)
        if cut_short:
            # rclpy's events executor may have been registering a node's callbacks. It loses count of them then, and
            # aborts the process when it is deleted.
            _leave()
    return 0


def _leave() -> NoReturn:
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(0)


def _executable() -> str:
    return Path(sys.argv[0]).stem


def _bad_input(error: Exception) -> int:
    print(f"{_executable()}: {one_line(error)}", file=sys.stderr, flush=True)
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
