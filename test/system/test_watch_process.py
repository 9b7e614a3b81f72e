"""`vergence watch` on a pseudo-terminal beside a running servo_node."""

import fcntl
import os
import pty
import select
import struct
import subprocess
import sys
import termios
import time
from pathlib import Path

import pytest

pytestmark = pytest.mark.system


def test_it_draws_the_joints_until_q_is_pressed(domain_id: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("ROS_HOME", str(tmp_path))
    node = subprocess.Popen([sys.executable, "-m", "vergence_servo.ros.servo_node"], stderr=subprocess.DEVNULL)
    master, slave = pty.openpty()
    # A terminal has a size of its own: readline may have left LINES in this process's environment, behind os.environ.
    fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", 60, 120, 0, 0))
    env = {name: value for name, value in os.environ.items() if name not in ("LINES", "COLUMNS")}
    argv = [sys.executable, "-m", "vergence_bringup.command_line", "watch"]
    watch = subprocess.Popen(argv, stdin=slave, stdout=slave, stderr=slave, start_new_session=True, env=env)
    os.close(slave)
    try:
        shown, deadline_s = "", time.monotonic() + 90
        while "pan_right " not in shown or "servo_node: servos: released" not in shown:
            assert select.select([master], [], [], max(0.0, deadline_s - time.monotonic()))[0], shown
            shown += os.read(master, 65536).decode(errors="replace")
        os.write(master, b"q")
        # Its end is the end of the terminal: reading then fails.
        while select.select([master], [], [], 90.0)[0]:
            try:
                shown += os.read(master, 65536).decode(errors="replace")
            except OSError:
                break
        assert watch.wait(90) == 0
        assert "\033[?1049h" in shown
        assert "\033[?1049l" in shown
    finally:
        for process in (watch, node):
            process.terminate()
            process.wait(90)
        os.close(master)
