"""A small process that releases the servos if servo_node dies without doing so.

Hardware PWM, a PCA9685 and a pigpio daemon go on pulsing when the process that set them is killed. The guardian holds
the other end of a pipe: when the pipe ends without a farewell, it opens the backend itself and stops every channel.
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

from vergence_servo.drivers.protocol import DriverIoError
from vergence_servo.drivers.registry import open_driver

_FAREWELL = b"released\n"


class Guardian:
    """The guarded process's side. A context is not needed: the end of this process is what the guardian waits for."""

    def __init__(self, backend: str, values: Mapping[str, Any], channels: Sequence[int]) -> None:
        """Start the guardian of these channels of a backend with these parameters. Raises OSError."""
        self._process = subprocess.Popen(
            [sys.executable, "-m", "vergence_servo.guardian", backend, json.dumps(dict(values)), *map(str, channels)],
            stdin=subprocess.PIPE,
            start_new_session=True,  # a Ctrl-C in the terminal is for the node, not for its guardian
        )

    @property
    def alive(self) -> bool:
        """True while the guardian waits."""
        return self._process.poll() is None

    def dismiss(self) -> None:
        """Tell the guardian that all is released, and wait for its end."""
        try:
            self._process.communicate(_FAREWELL, timeout=5.0)
        except (BrokenPipeError, ValueError):
            self._process.wait()
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


def main(args: Sequence[str] | None = None) -> int:
    """Wait for the end of the pipe on standard input; release unless it ended with a farewell."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("backend")
    parser.add_argument("values", type=json.loads)
    parser.add_argument("channels", type=int, nargs="+")
    options = parser.parse_args(args)
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    heard = b""
    while part := os.read(0, 4096):
        heard = (heard + part)[-len(_FAREWELL) :]
    if heard == _FAREWELL:
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
