"""First run: from a clone of this repository to the first picture of the demo, with the packages in pip's cache.

A clone is set up twice in the same folder: what the first time puts into pip's cache, the second finds there.
"""

import os
import shutil
import signal
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from bench.results import Row

ROOT = Path(__file__).resolve().parents[1]
_LONGEST_S = 1200.0
_LOOKED_EVERY_S = 0.1
_WHEELS_FOUND = "_ROS_WHEELS_BOOTSTRAP_COMPLETE"
"""Set by the ROS wheels once their libraries can be found; with it a child process adds none, whatever its path."""


class SetupError(RuntimeError):
    """The clone could not be made or set up, or its demo wrote no picture."""


def run(say: Callable[[str], None]) -> list[Row]:
    """Clone, set up and start the demo; VERGENCE_SETUP_WARM=1 where pip's cache is known to hold the packages."""
    with tempfile.TemporaryDirectory() as folder:
        clone = Path(folder) / "vergence"
        if os.environ.get("VERGENCE_SETUP_WARM") != "1":
            say("a first set-up, for pip's cache")
            _clone(clone)
            _set_up(clone)
            shutil.rmtree(clone)
        say("from clone to the first picture")
        began_s = time.monotonic()
        _clone(clone)
        cloned_s = time.monotonic()
        _set_up(clone)
        ready_s = time.monotonic()
        _first_picture(clone)
        end_s = time.monotonic()
    say(f"clone {cloned_s - began_s:.0f} s, set-up {ready_s - cloned_s:.0f} s, first picture {end_s - ready_s:.0f} s")
    unit = f"s on {os.cpu_count()} cores"
    return [
        Row("setup.first_picture_s", end_s - began_s, unit),
        Row("setup.environment_s", ready_s - cloned_s, unit),
    ]


def _clone(clone: Path) -> None:
    _checked(["git", "clone", "--quiet", str(ROOT), str(clone)], ROOT)


def _set_up(clone: Path) -> None:
    _checked(["make", "setup"], clone)


def _checked(command: list[str], folder: Path) -> None:
    done = subprocess.run(command, cwd=folder, env=_environment(), capture_output=True, text=True, timeout=_LONGEST_S)
    if done.returncode:
        raise SetupError(f"{' '.join(command)} ended with {done.returncode}: {done.stderr[-2000:]}")


def _first_picture(clone: Path) -> None:
    """Start the demo and wait for the first picture that it writes."""
    out, log = clone / "out" / "first", clone / "out" / "first.log"
    log.parent.mkdir(exist_ok=True)
    with log.open("w", encoding="utf-8") as output:
        demo = subprocess.Popen(
            ["make", "demo", f"ARGS=--short --no-page --out {out}"],
            cwd=clone,
            env=_environment(),
            stdout=output,
            stderr=output,
            start_new_session=True,
        )
    try:
        while not any(out.rglob("*.jpg")):
            if demo.poll() is not None:
                printed = log.read_text(encoding="utf-8")[-2000:]
                raise SetupError(f"the demo ended with {demo.returncode} before its first picture: {printed}")
            time.sleep(_LOOKED_EVERY_S)
    finally:
        if demo.poll() is None:
            os.killpg(demo.pid, signal.SIGTERM)  # the demo ends its nodes
            demo.wait(60.0)


def _environment() -> dict[str, str]:
    """Return what a shell has in which this repository was not sourced."""
    own = str(ROOT)
    kept = {name: value for name, value in os.environ.items() if own not in value or name == "PATH"}
    kept.pop(_WHEELS_FOUND, None)
    kept["PATH"] = os.pathsep.join(part for part in kept.get("PATH", "").split(os.pathsep) if not part.startswith(own))
    return kept
