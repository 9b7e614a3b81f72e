"""Cost of a simulated pair, of eyes that turn and of eyes at rest, and speed of the simulator in lockstep.

While nothing moves the view is not drawn anew: the noise and the JPEG of each image are.
"""

import time
from collections.abc import Callable
from contextlib import closing

import numpy as np

from bench.results import Row
from vergence_sim.parameters import SimParameters
from vergence_sim.simulator import Simulator

_PAIRS = 90
_BLIND_STEPS = 3000
_FRAME_S = 1.0 / 30.0


def run(say: Callable[[str], None]) -> list[Row]:
    """Measure pairs with realistic imperfections beside ideal ones, lockstep runs with and without pixels."""
    rows = []
    say("compiling a furnished room")
    began_s = time.perf_counter()
    realistic, ideal = Simulator(SimParameters()), Simulator(SimParameters.ideal())
    rows.append(Row("sim.start_s", time.perf_counter() - began_s, "s for two rooms"))
    with closing(realistic), closing(ideal):
        say(f"{_PAIRS} pairs with realistic and with ideal cameras")
        costs_ms, ideal_ms = _pairs_ms(realistic, turning=True), float(np.median(_pairs_ms(ideal, turning=True)))
        pair_ms, (fast_ms, slow_ms) = float(np.median(costs_ms)), np.percentile(costs_ms, (10, 90)).tolist()
        say(f"a pair of eyes that turn: {fast_ms:.1f} to {slow_ms:.1f} ms of CPU in eight of ten, all threads together")
        for name in ("sim.pair_ms", "sim.render_pair_ms"):
            rows.append(Row(name, pair_ms, "ms CPU", "ideal cameras, rendering alone", ideal_ms))
        rows.append(Row("sim.pair_ms.at_rest", float(np.median(_pairs_ms(realistic, turning=False))), "ms CPU"))
        began_s, sim_began_s = time.perf_counter(), realistic.time_s
        _follow(realistic, _PAIRS)
        factor = (realistic.time_s - sim_began_s) / (time.perf_counter() - began_s)
        blind = Simulator(SimParameters.of({"motion.kind": "sinusoid", "motion.y_m": 0.1}), render=False)
        began_s = time.perf_counter()
        for step in range(_BLIND_STEPS):
            blind.advance_to(step * 0.01)
            blind.truth()
        blind_factor = blind.time_s / (time.perf_counter() - began_s)
    rows.append(Row("sim.realtime_factor", factor, "x", "without pixels, truth at 100 Hz", blind_factor))
    return rows


def _pairs_ms(simulator: Simulator, turning: bool) -> list[float]:
    costs_ms = []
    for number in range(_PAIRS):
        if turning:
            simulator.set_head({"pan_left": 0.1 * np.sin(number / 20), "pan_right": 0.1 * np.sin(number / 20)})
        simulator.advance(_FRAME_S)
        began_s = time.process_time()
        simulator.view("left")
        simulator.view("right")
        costs_ms.append(1e3 * (time.process_time() - began_s))
    return costs_ms


def _follow(simulator: Simulator, pairs: int) -> None:
    start_s = simulator.time_s
    for number in range(pairs):
        simulator.advance_to(start_s + number * _FRAME_S)
        simulator.command({"pan_left": 0.2 * np.sin(number / 20), "pan_right": 0.1})
        simulator.capture()
    simulator.advance_to(start_s + pairs * _FRAME_S)
