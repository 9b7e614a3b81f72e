"""A small process that releases the servos if servo_node dies without doing so.

Hardware PWM, a PCA9685 and a pigpio daemon go on pulsing when the process that set them is killed. The guardian holds
the other end of a pipe: when the pipe ends without the dismissal message, it opens the backend and stops every channel.
It cannot help where the whole computer stops: docs/servos.md says what can.
"""

import argparse
import json
import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from typing import Any

from vergence_servo.driver_set import DriverSet
from vergence_servo.drivers.protocol import DriverIoError
from vergence_servo.drivers.registry import open_driver

_DISMISSAL = b"released\n"


class Guardian:
    """The guarded process's side. It needs no context manager: the guardian acts when this process ends."""

    def __init__(
        self, backend: str, values: Mapping[str, Any], channels: Sequence[int], locks: Sequence[int] = ()
    ) -> None:
        """Start the guardian of these channels of a backend with these parameters. Raises OSError.

        It inherits the open files `locks`: no other process may own the channels before they have been released.
        """
        self._process = subprocess.Popen(
            [sys.executable, "-m", "vergence_servo.guardian", backend, json.dumps(dict(values)), *map(str, channels)],
            stdin=subprocess.PIPE,
            pass_fds=locks,
            start_new_session=True,  # a Ctrl-C in the terminal is for the node, not for its guardian
        )

    @property
    def alive(self) -> bool:
        """True while the guardian runs."""
        return self._process.poll() is None

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

    def __init__(self, drivers: DriverSet, channels: Mapping[str, int]) -> None:
        """Start them; `channels` are those of the joints. Raises OSError."""
        self._running: list[Guardian] = []
        try:
            for backend, driver in drivers.by_backend.items():
                if driver.outlives_process:
                    guarded = [channels[joint] for joint in drivers.joints(backend)]
                    self._running.append(Guardian(backend, drivers.values[backend], guarded, drivers.locks.descriptors))
        except BaseException:
            self.dismiss()
            raise

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
    """Wait for the end of the pipe on standard input; release unless it ended with the dismissal."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("backend")
    parser.add_argument("values", type=json.loads)
    parser.add_argument("channels", type=int, nargs="+")
    options = parser.parse_args(args)
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    received = b""
    while part := os.read(0, 4096):
        received = (received + part)[-len(_DISMISSAL) :]
    if received == _DISMISSAL:
        return 0
    try:
        driver = open_driver(options.backend, options.values)
    except ValueError as error:
        print(f"guardian: servo_node died, and its channels cannot be released: {error}", file=sys.stderr)
        return 1
    status = 0
    for channel in options.channels:
        try:
            driver.release(channel)
        except DriverIoError as error:
            print(f"guardian: channel {channel} could not be released: {error}", file=sys.stderr)
            status = 1
    driver.close()
    print(f"guardian: servo_node died; released channels {options.channels}", file=sys.stderr)
    return status


if __name__ == "__main__":
    sys.exit(main())
