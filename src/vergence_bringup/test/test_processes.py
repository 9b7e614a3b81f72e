"""Processes are started and ended together, whatever they do."""

import os
import signal
import stat
import subprocess
import sys
import time

import pytest

from vergence_bringup.graph_errors import ProcessError
from vergence_bringup.ros import processes
from vergence_bringup.ros.processes import NodeCommand, ProcessGroup, find_executable


@pytest.fixture
def script(tmp_path, monkeypatch):
    """Make the workspace's executables be scripts of the test; return a function that writes one."""

    def write(name, body):
        path = tmp_path / "lib" / "package" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"#!{sys.executable}\n{body}\n")
        path.chmod(path.stat().st_mode | stat.S_IXUSR)
        return NodeCommand("package", name, params_file=tmp_path / "none.yaml")

    monkeypatch.setattr(processes, "get_package_prefix", lambda package: str(tmp_path))
    return write


_READY = "import signal, sys, time\nprint('ready', flush=True)\n"


def _wait_ready(log):
    deadline = time.monotonic() + 90
    while b"ready" not in log.read_bytes():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def test_sigint_ends_them_and_their_status_is_returned(script, tmp_path):
    body = (
        "import signal, sys, time\nsignal.signal(signal.SIGINT, lambda *_: sys.exit(0))\nprint('ready', flush=True)\n"
    )
    with ProcessGroup(log_dir=tmp_path / "log") as group:
        group.start("good", script("good", body + "time.sleep(60)"))
        _wait_ready(tmp_path / "log" / "good.log")
        group.check()
        assert group.stop() == {"good": 0}


def test_one_that_will_not_end_is_killed(script, tmp_path):
    body = (
        "import signal, time\nfor n in (signal.SIGINT, signal.SIGTERM): signal.signal(n, signal.SIG_IGN)\n"
        "print('ready', flush=True)\ntime.sleep(60)"
    )
    with ProcessGroup(log_dir=tmp_path / "log") as group:
        group.start("stubborn", script("stubborn", body))
        _wait_ready(tmp_path / "log" / "stubborn.log")
        assert group.stop(timeout_s=0.2) == {"stubborn": -signal.SIGKILL}


def test_one_that_ended_by_itself_is_named_with_the_end_of_its_log(script, tmp_path):
    with ProcessGroup(log_dir=tmp_path / "log") as group:
        group.start("weak", script("weak", "import sys; print('parameter x must be 1: got 3'); sys.exit(2)"))
        group._running["weak"].wait(90)
        with pytest.raises(ProcessError, match=r"weak ended with status 2[\s\S]*parameter x must be 1"):
            group.check()


def test_children_die_with_a_parent_that_is_killed(script, tmp_path):
    command = script("child", _READY + "time.sleep(60)")
    parent = subprocess.Popen(
        [
            sys.executable,
            "-c",
            "import sys, time\nfrom pathlib import Path\nfrom vergence_bringup.ros import processes\n"
            f"processes.get_package_prefix = lambda package: {str(tmp_path)!r}\n"
            f"group = processes.ProcessGroup(log_dir=Path({str(tmp_path / 'log')!r}))\n"
            f"command = processes.NodeCommand('package', 'child', params_file=Path({str(command.params_file)!r}))\n"
            "group.start('child', command)\n"
            "print(group._running['child'].pid, flush=True)\ntime.sleep(60)",
        ],
        stdout=subprocess.PIPE,
        text=True,
    )
    assert parent.stdout is not None
    child = int(parent.stdout.readline())
    _wait_ready(tmp_path / "log" / "child.log")
    parent.kill()
    parent.wait()
    parent.stdout.close()
    deadline = time.monotonic() + 90
    while _alive(child):
        assert time.monotonic() < deadline
        time.sleep(0.01)


def _alive(pid):
    try:
        with open(f"/proc/{pid}/stat") as file:
            return file.read().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False


def test_parameters_become_yaml_on_the_command_line(script):
    argv = NodeCommand(
        "package",
        script("x", "").executable,
        {"rig": "", "rate_hz": 30.0, "on": True, "windows_px": (50, 100), "name": "7"},
        ["image:=left/image"],
        params_file=None if os.environ.get("VERGENCE_CONFIG_DIR") else script("x", "").params_file,
    ).argv()
    assert 'rig:=""' in argv
    assert "rate_hz:=30.0" in argv
    assert "on:=true" in argv
    assert "windows_px:=[50, 100]" in argv
    assert 'name:="7"' in argv
    assert argv[-2:] == ["-r", "image:=left/image"]


def test_an_executable_that_is_not_there_is_named():
    with pytest.raises(ProcessError, match="vergence_nothing"):
        find_executable("vergence_nothing", "node")
    with pytest.raises(ProcessError, match="no_such_node"):
        find_executable("vergence_metric", "no_such_node")
