"""What a closed simulator leaves behind in this process."""

import os
import subprocess
import sys
import threading
from pathlib import Path

import mujoco
import pytest

from vergence_sim.renderer import RenderError
from vergence_sim.simulator import Simulator

THREADS = 4
MOST_GROWTH_MB = 150.0
"""Four simulators that keep what they used grow a process by 600 MB and more."""


def resident_mb() -> float:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def use_and_close() -> None:
    simulator = Simulator()
    simulator.view("left")
    simulator.close()


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="only Linux says how much memory a process has")
def test_simulators_made_and_closed_in_threads_leave_no_memory_behind() -> None:
    try:
        use_and_close()
    except RenderError as error:
        pytest.skip(f"no OpenGL here: {error}")
    assert mujoco.mj_getCacheSize(mujoco.mj_getCache()) == 0
    before_mb = resident_mb()
    # Threads that live on: the C library gives each its own store of freed memory. One after the other makes its own.
    finished = threading.Event()
    for _ in range(THREADS):
        closed = threading.Event()

        def run(closed: threading.Event = closed) -> None:
            use_and_close()
            closed.set()
            finished.wait(120.0)

        threading.Thread(target=run, daemon=True).start()
        assert closed.wait(120.0)
    after_mb = resident_mb()
    finished.set()
    assert after_mb - before_mb < MOST_GROWTH_MB


ROOMS = """
import os
from pathlib import Path
from vergence_rig.rig import default_rig
from vergence_sim.parameters import SimParameters, WorldParameters
from vergence_sim.scene import build_scene

def resident_mb():
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20

def build(seeds):
    for seed in seeds:
        build_scene(default_rig(), SimParameters(world=WorldParameters(seed=seed)), (0.8, 0.8))

build(range(101, 106))  # more than the cache holds
before_mb = resident_mb()
build(range(106, 110))
print(resident_mb() - before_mb)
"""


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="only Linux says how much memory a process has")
def test_rooms_beyond_the_cache_leave_no_memory_behind() -> None:
    # In a process of their own: what other tests have freed here is taken again, or not, as it happens.
    grown = subprocess.run([sys.executable, "-c", ROOMS], capture_output=True, text=True, timeout=240)
    assert grown.returncode == 0, grown.stderr
    assert float(grown.stdout) < MOST_GROWTH_MB
