"""What a running process has cost so far, and its end; Linux only."""

import subprocess
from pathlib import Path
from typing import Any


def cpu_s(pid: int) -> float:
    """Return the CPU time of a process's threads so far, to the nanosecond: clock ticks are too coarse for this."""
    threads = Path(f"/proc/{pid}/task").iterdir()
    return sum(int((thread / "schedstat").read_text().split()[0]) for thread in threads) * 1e-9


def rss_mb(pid: int) -> float:
    """Return the memory that a process holds [MB]."""
    status = Path(f"/proc/{pid}/status").read_text(encoding="utf-8")
    return int(status.partition("VmRSS:")[2].split()[0]) / 1024.0


def end(process: "subprocess.Popen[Any]", patience_s: float) -> None:
    """Wait for a process that was asked to end, and kill it if it does not."""
    try:
        process.wait(patience_s)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
