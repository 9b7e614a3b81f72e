"""The visual encoder on rendered rooms: the accuracy of its vergence, and its effect on the distance.

An SG90 head, whose every servo differs from its data sheet, turns to a target in the lockstep simulator under the gaze
controller. What its cameras see at rest is rendered with all their imperfections and read by the encoder, to which
the cameras are described as a calibration would: focal lengths, image centres and lenses a little off.
"""

import math
from collections.abc import Callable
from contextlib import closing
from dataclasses import replace

import numpy as np

from bench import gaze_runs
from bench import gaze_scenarios as scenarios
from bench.encoder_readings import RenderedRooms
from bench.gaze_runs import Setting
from bench.heads import identified, identify
from bench.results import Row
from vergence_rig.servo import SG90
from vergence_sim.parameters import SimParameters

Say = Callable[[str], None]

WORLDS = range(60, 65)
DISTANCES_M = (0.3, 0.5, 1.0, 1.5)
PER_WORLD = 2
SETTING = Setting(servo="sg90")
WITHOUT = "joints alone"


def run(say: Say) -> list[Row]:
    """Run every trial with and without the encoder and return the rows."""
    identify(say)
    rig = identified().with_servos(SG90)
    readings, errors_rad = [], []
    said: dict[bool, list[np.ndarray]] = {True: [], False: []}
    distances: list[float] = []
    for world in WORLDS:
        with closing(RenderedRooms(rig, SimParameters.of({"world.seed": world, "seed": world}))) as rooms:
            for number, distance in enumerate(DISTANCES_M):
                for scenario in scenarios.at_distance(PER_WORLD, distance, None, seed=100 * world + number):
                    rooms.begin(scenario.target(0.0), scenario.seed)
                    for encoder in (rooms, None):
                        trace = gaze_runs.run(replace(scenario, encoder=encoder), SETTING)
                        said[encoder is not None].append(trace.distance_m[-1] / distance)
                    distances.append(distance)
            readings += rooms.readings
            errors_rad += rooms.errors_rad
        say(f"world {world}: {len(errors_rad)} of {len(readings)} pairs read")
    rows = _reading_rows(readings, np.array(errors_rad))
    with_it, without = (np.array(said[encoder]) for encoder in (True, False))
    for distance in DISTANCES_M:
        here = np.array(distances) == distance
        rows.append(_row(f"distance_error.sg90.at_{distance:g}_m", _error, with_it[here], without[here]))
    rows.append(_row("distance_error.sg90", _error, with_it, without))
    rows.append(_row("distance_interval.sg90", _inside, with_it, without, "share inside"))
    rows.append(_row("distance_interval_width.sg90", _width, with_it, without))
    return rows


def _reading_rows(readings: list, errors_rad: np.ndarray) -> list[Row]:
    accepted = [reading.rotation for reading in readings if reading.ok]
    sigmas = np.array([rotation.sigma_rad for rotation in accepted])
    joints = np.array(
        [r.joint_vergence_rad - r.rotation.vergence_rad for r in readings if r.ok]
    )  # the joints' errors, apart from the encoder's own
    sizes = np.degrees(np.abs(errors_rad))
    return [
        Row("encoder.believed", len(accepted) / max(len(readings), 1), "of the pairs at rest"),
        Row("encoder.vergence_error_deg", _median(sizes), "deg", "joint_states", _median(np.degrees(np.abs(joints)))),
        Row("encoder.vergence_error_p95_deg", float(np.quantile(sizes, 0.95)), "deg"),
        Row("encoder.vergence_sigma_deg", _median(np.degrees(sigmas)), "deg"),
        Row("encoder.vergence_interval", float(np.mean(np.abs(errors_rad) < 1.96 * sigmas)), "share inside"),
        Row("encoder.matches", _median([rotation.matches for rotation in accepted]), "a pair"),
        Row("encoder.residual_px", _median([reading.residual_px for reading in readings if reading.ok]), "px"),
        Row("encoder.pair_ms", _median([1e3 * reading.took_s for reading in readings]), "ms"),
    ]


def _row(
    what: str,
    figure: Callable[[np.ndarray], float],
    with_it: np.ndarray,
    without: np.ndarray,
    unit: str = "of the distance",
) -> Row:
    return Row(f"encoder.{what}", figure(with_it), unit, WITHOUT, figure(without))


def _error(said: np.ndarray) -> float:
    return _median(np.abs(said[:, 0] - 1.0))


def _inside(said: np.ndarray) -> float:
    return float(np.mean((said[:, 1] <= 1.0) & (said[:, 2] >= 1.0)))


def _width(said: np.ndarray) -> float:
    return _median(said[:, 2] - said[:, 1])


def _median(values: object) -> float:
    values = np.asarray(values, np.float64)
    return float(np.median(values)) if values.size else math.nan
