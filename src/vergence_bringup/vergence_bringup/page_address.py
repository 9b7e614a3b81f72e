"""The address of the page of a web_node that was started with a log file."""

import time
from collections.abc import Callable
from pathlib import Path

from vergence_bringup.graph_errors import ProcessError

_MARK = "the page: "
_STARTED_WITHIN_S, _LOOK_S = 60.0, 0.05


def page_address(log: Path, check_alive: Callable[[], None]) -> str:
    """Return the first address that web_node writes into its log; `check_alive` raises when it has ended.

    Raises ProcessError where none is written within a minute.
    """
    end_s = time.monotonic() + _STARTED_WITHIN_S
    while time.monotonic() < end_s:
        # A line that is still being written has no end yet.
        for line in log.read_text(encoding="utf-8", errors="replace").splitlines(keepends=True):
            if _MARK in line and line.endswith("\n"):
                return line.partition(_MARK)[2].strip()
        check_alive()
        time.sleep(_LOOK_S)
    raise ProcessError(f"web_node must write its address into {log} within {_STARTED_WITHIN_S:g} s: it has not")
