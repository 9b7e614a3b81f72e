"""A small process that releases the servos if servo_node dies or hangs without doing so.

Hardware PWM, a PCA9685 and a pigpio daemon go on pulsing when the process that set them is killed or stopped. The
guardian holds the other end of a pipe, on which the node's own timer writes a heartbeat: when the heartbeat pauses for
too long, or the pipe ends without the dismissal message, it opens the backend and stops every channel. It cannot help
where the whole computer stops: docs/servos.md says what can.
"""

import argparse
import contextlib
import json
import math
import os
import select
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from typing import Any

from vergence_servo.driver_set import DriverSet
from vergence_servo.drivers.protocol import DriverIoError
from vergence_servo.drivers.registry import open_driver

_DISMISSAL = b"released\n"
_HEARTBEAT = b"."
_BEATS = 10  # in the time after which a pause counts
_SHARE = 0.8  # of that time, after which the node itself takes its channels for released


class Guardian:
    """The guarded process's side. It needs no context manager: the guardian acts when this process ends."""

    def __init__(
        self,
        backend: str,
        values: Mapping[str, Any],
        channels: Sequence[int],
        timeout_s: float,
        locks: Sequence[int] = (),
    ) -> None:
        """Start the guardian of these channels of a backend with these parameters. Raises OSError.

        It acts `timeout_s` after the last heartbeat, once there has been one.
        It inherits the open files `locks`: no other process may own the channels before they have been released.
        """
        numbers = map(str, (timeout_s, *channels))
        self._process = subprocess.Popen(
            [sys.executable, "-m", "vergence_servo.guardian", backend, json.dumps(dict(values)), *numbers],
            stdin=subprocess.PIPE,
            pass_fds=locks,
            start_new_session=True,  # a Ctrl-C in the terminal is for the node, not for its guardian
        )
        assert self._process.stdin is not None
        self._pipe = self._process.stdin.fileno()
        os.set_blocking(self._pipe, False)  # a guardian that hangs must not hold up the node

    @property
    def alive(self) -> bool:
        """True while the guardian runs."""
        return self._process.poll() is None

    def beat(self) -> None:
        """Write the heartbeat; nothing happens where the guardian has ended."""
        with contextlib.suppress(OSError):
            os.write(self._pipe, _HEARTBEAT)

    def dismiss(self) -> None:
        """End the guardian without an action, after all servos have been released."""
        try:
            self._process.communicate(_DISMISSAL, timeout=5.0)
        except (BrokenPipeError, ValueError):
            self._process.wait()
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


class Guardians:
    """One guardian for each backend that goes on pulsing when this process dies, so that none waits for another."""

    def __init__(self, drivers: DriverSet, channels: Mapping[str, int], timeout_s: float) -> None:
        """Start them; `channels` are those of the joints. Raises OSError."""
        self._running: list[Guardian] = []
        self._timeout_s, self._beaten_s = timeout_s, math.inf
        try:
            for backend, driver in drivers.by_backend.items():
                if driver.outlives_process:
                    guarded = [channels[joint] for joint in drivers.joints(backend)]
                    locks = drivers.locks.descriptors
                    self._running.append(Guardian(backend, drivers.values[backend], guarded, timeout_s, locks))
        except BaseException:
            self.dismiss()
            raise

    def beat(self, now_s: float) -> float:
        """Write the heartbeat where it is due; return the pause [s] if the guardians have acted on one, else 0."""
        pause_s = now_s - self._beaten_s
        if 0 <= pause_s < self._timeout_s / _BEATS:
            return 0.0
        self._beaten_s = now_s
        for guardian in self._running:
            guardian.beat()
        return pause_s if self._running and pause_s > _SHARE * self._timeout_s else 0.0

    @property
    def state(self) -> str:
        """What the diagnostics say: none, running, or ended where one of them has."""
        if not self._running:
            return "none"
        return "running" if all(guardian.alive for guardian in self._running) else "ended"

    def dismiss(self) -> None:
        """End them without an action, after all servos have been released."""
        for guardian in self._running:
            guardian.dismiss()


def main(args: Sequence[str] | None = None) -> int:
    """Release where the heartbeat on standard input pauses, and at its end unless it ended with the dismissal."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("backend")
    parser.add_argument("values", type=json.loads)
    parser.add_argument("timeout_s", type=float)
    parser.add_argument("channels", type=int, nargs="+")
    options = parser.parse_args(args)
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    received = b""
    waited_for = False  # the first heartbeat comes once the node is made
    while True:
        if waited_for and not _readable(options.timeout_s):
            waited_for = False
            _release(options, f"servo_node has hung for {options.timeout_s:g} s")
            continue
        part = os.read(0, 4096)
        if not part:
            break
        waited_for = True
        received = (received + part)[-len(_DISMISSAL) :]
    return 0 if received == _DISMISSAL else _release(options, "servo_node died")


def _readable(timeout_s: float) -> bool:
    """Return whether something comes within the time; what came while this process itself was held up counts."""
    return any(bool(select.select([0], [], [], wait_s)[0]) for wait_s in (timeout_s, 0.0))


def _release(options: argparse.Namespace, why: str) -> int:
    try:
        driver = open_driver(options.backend, options.values)
    except ValueError as error:
        print(f"guardian: {why}, and its channels cannot be released: {error}", file=sys.stderr, flush=True)
        return 1
    status = 0
    for channel in options.channels:
        try:
            driver.release(channel)
        except DriverIoError as error:
            print(f"guardian: channel {channel} could not be released: {error}", file=sys.stderr, flush=True)
            status = 1
    driver.close()
    print(f"guardian: {why}; released channels {options.channels}", file=sys.stderr, flush=True)
    return status


if __name__ == "__main__":
    sys.exit(main())
