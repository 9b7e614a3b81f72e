"""Seeded scenarios for the gaze controller: where targets are, how they move, and where the eyes begin."""

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from bench.gaze_runs import Encoder, Scenario
from bench.heads import kinematics
from vergence_rig.kinematics import Kinematics

Array = npt.NDArray[np.float64]

CROSSED_S = 2.5
_HALF_FIELD_RAD = (math.atan(290.0 / 539.0), math.atan(210.0 / 539.0))


def place(distance_m: float, azimuth_rad: float, elevation_rad: float) -> Array:
    """Return a point (3,) at a distance and direction from between the eyes; azimuth left, elevation up positive."""
    flat = math.cos(azimuth_rad)
    return distance_m * np.array(
        [flat * math.cos(elevation_rad), math.sin(azimuth_rad), flat * math.sin(elevation_rad)]
    )


def still(point_m: Array) -> Callable[[float], Array]:
    """Return a target that stays."""
    return lambda time_s: point_m


def pans(point_m: Array, head: Kinematics | None = None) -> tuple[float, float, float]:
    """Return pan_left, pan_right, tilt of the eyes that fixate a point; of the default simulated head if none."""
    eyes = (head or kinematics()).gaze_for_point(point_m)
    return eyes.pan_left_rad, eyes.pan_right_rad, eyes.tilt_rad


def in_view_start(point_m: Array, random: np.random.Generator, head: Kinematics | None = None) -> dict[str, float]:
    """Return a random pose of the eyes from which both see the point; of the default simulated head if none."""
    left, right, tilt = pans(point_m, head)
    while True:
        version, vergence = random.uniform(-0.6, 0.6), random.uniform(0.01, 0.25)
        pose = {
            "pan_left": version - 0.5 * vergence,
            "pan_right": version + 0.5 * vergence,
            "tilt": random.uniform(-0.4, 0.4),
        }
        seen = (
            abs(left - pose["pan_left"]) < _HALF_FIELD_RAD[0] - 0.02
            and abs(right - pose["pan_right"]) < _HALF_FIELD_RAD[0] - 0.02
            and abs(tilt - pose["tilt"]) < _HALF_FIELD_RAD[1] - 0.05
        )
        if seen:
            return pose


def fixating(point_m: Array) -> dict[str, float]:
    """Return the pose of the eyes that fixates a point."""
    return dict(zip(("pan_left", "pan_right", "tilt"), pans(point_m), strict=True))


def _random_place(random: np.random.Generator) -> Array:
    # Uniform in vergence demand rather than in distance alone would crowd the near ones; half and half.
    distance = random.uniform(0.25, 2.0)
    return place(distance, math.radians(random.uniform(-35, 35)), math.radians(random.uniform(-20, 20)))


def static(count: int, given: str, seed: int = 1) -> list[Scenario]:
    """Targets at rest within 0.25 to 2 m, azimuth +-35 and elevation +-20 degrees; poses that see them."""
    scenarios = []
    for i in range(count):
        random = np.random.default_rng([seed, i])
        point = _random_place(random)
        scenarios.append(Scenario(still(point), in_view_start(point, random), 3.0, given, seed=1000 * seed + i))
    return scenarios


def out_of_view(count: int, given: str = "class", seed: int = 2) -> list[Scenario]:
    """Targets anywhere in reach that neither eye sees at the start."""
    scenarios: list[Scenario] = []
    i = 0
    while len(scenarios) < count:
        random = np.random.default_rng([seed, i])
        i += 1
        azimuth, elevation = math.radians(random.uniform(-50, 50)), math.radians(random.uniform(-38, 38))
        point = place(random.uniform(0.3, 2.0), azimuth, elevation)
        left, right, tilt = pans(point)
        if max(abs(left), abs(right)) > math.radians(58) or abs(tilt) > math.radians(44):
            continue
        version = random.uniform(-0.5, 0.5)
        pose = {"pan_left": version - 0.03, "pan_right": version + 0.03, "tilt": random.uniform(-0.4, 0.4)}
        aside = min(abs(left - pose["pan_left"]), abs(right - pose["pan_right"]))
        if aside > _HALF_FIELD_RAD[0] + 0.1 or abs(tilt - pose["tilt"]) > _HALF_FIELD_RAD[1] + 0.1:
            scenarios.append(Scenario(still(point), pose, 10.0, given, seed=1000 * seed + i))
    return scenarios


def steps(count: int, given: str = "pairs", seed: int = 3) -> list[Scenario]:
    """A fixated target that jumps sideways by 5 to 25 degrees at 1.5 s."""
    scenarios = []
    for i in range(count):
        random = np.random.default_rng([seed, i])
        distance, azimuth = random.uniform(0.4, 1.5), math.radians(random.uniform(-15, 15))
        jump = math.radians(random.uniform(5, 25)) * random.choice([-1, 1])
        before, after = place(distance, azimuth, 0.05), place(distance, azimuth + jump, 0.05)
        scenarios.append(Scenario(_switch(before, after, 1.5), fixating(before), 3.5, given, seed=1000 * seed + i))
    return scenarios


def depth_steps(count: int, given: str = "pairs", seed: int = 4) -> list[Scenario]:
    """A fixated target that jumps in depth at 1.5 s."""
    scenarios = []
    for i in range(count):
        random = np.random.default_rng([seed, i])
        azimuth = math.radians(random.uniform(-20, 20))
        near, far = random.uniform(0.3, 0.6), random.uniform(0.9, 2.0)
        pair = (near, far) if random.random() < 0.5 else (far, near)
        before, after = (place(distance, azimuth, 0.0) for distance in pair)
        scenarios.append(Scenario(_switch(before, after, 1.5), fixating(before), 3.5, given, seed=1000 * seed + i))
    return scenarios


def ramps(speeds_deg_s: tuple[float, ...], given: str = "pairs", seed: int = 5) -> list[Scenario]:
    """Targets that move sideways at a constant speed from 1 s on, in both directions."""
    scenarios = []
    for i, speed in enumerate(speed for magnitude in speeds_deg_s for speed in (magnitude, -magnitude)):
        begin = -math.copysign(30.0, speed)
        travel_s = min(60.0 / abs(speed), 3.0)

        def target(time_s: float, begin: float = begin, speed: float = speed, travel_s: float = travel_s) -> Array:
            moved = speed * min(max(time_s - 1.0, 0.0), travel_s)
            return place(0.8, math.radians(begin + moved), 0.05)

        scenarios.append(Scenario(target, fixating(target(0.0)), 1.0 + travel_s, given, seed=1000 * seed + i))
    return scenarios


def sinusoids(frequencies_hz: tuple[float, ...], given: str = "pairs", seed: int = 6) -> list[Scenario]:
    """Targets that swing +-10 degrees sideways and a little in depth."""
    scenarios = []
    for i, frequency in enumerate(frequencies_hz):

        def target(time_s: float, frequency: float = frequency) -> Array:
            phase = math.tau * frequency * max(time_s - 0.5, 0.0)
            return place(0.8 + 0.1 * math.sin(0.5 * phase), math.radians(10.0) * math.sin(phase), 0.0)

        duration = 0.5 + max(2.0 / frequency, 3.0)
        scenarios.append(Scenario(target, fixating(target(0.0)), min(duration, 10.5), given, seed=1000 * seed + i))
    return scenarios


def occlusions(count: int, given: str = "pairs", seed: int = 7) -> list[Scenario]:
    """A fixated target hidden for one second."""
    scenarios = []
    for i in range(count):
        random = np.random.default_rng([seed, i])
        point = _random_place(random) + np.array([0.3, 0.0, 0.0])
        scenarios.append(
            Scenario(
                still(point),
                fixating(point),
                4.5,
                given,
                seed=1000 * seed + i,
                visible=lambda time_s: not 2.0 <= time_s < 3.0,
            )
        )
    return scenarios


def crossings(count: int, given: str = "class", seed: int = 10) -> list[Scenario]:
    """A target that passes at 10 degrees/s before another at 1.6 to 2.2 times its distance, straight ahead at 2.5 s.

    While the two overlap, every estimator takes one for the other about half of the time, in bursts of a tenth of a
    second; the detector takes the other for the target as soon as it is 6 degrees near, in three bursts out of ten.
    """
    scenarios = []
    for i in range(count):
        random = np.random.default_rng([seed, i])
        distance, way = random.uniform(0.4, 0.8), random.choice([-1.0, 1.0])
        elevation = math.radians(random.uniform(-10.0, 10.0))
        other = place(distance * random.uniform(1.6, 2.2), 0.0, elevation)

        def azimuth(time_s: float, way: float = way) -> float:
            return math.radians(way * 10.0 * (min(max(time_s, 1.0), CROSSED_S + 1.5) - CROSSED_S))

        def target(
            time_s: float,
            distance: float = distance,
            elevation: float = elevation,
            azimuth: Callable[[float], float] = azimuth,
        ) -> Array:
            return place(distance, azimuth(time_s), elevation)

        def taken_for(
            near_rad: float,
            share: float,
            draws: Array,
            other: Array = other,
            azimuth: Callable[[float], float] = azimuth,
        ) -> Callable[[float], Array | None]:
            def mistaken(time_s: float) -> Array | None:
                wrong = abs(azimuth(time_s)) < near_rad and draws[int(max(time_s, 0.0) * 10.0) % draws.size] < share
                return other if wrong else None

            return mistaken

        overlap, near = math.radians(2.5), math.radians(6.0)
        scenarios.append(
            Scenario(
                target,
                fixating(target(0.0)),
                CROSSED_S + 3.0,
                given,
                seed=1000 * seed + i,
                mistaken={
                    "fovea": taken_for(overlap, 0.5, random.random(100)),
                    "track": taken_for(overlap, 0.5, random.random(100)),
                    "box": taken_for(near, 0.3, random.random(100)),
                },
            )
        )
    return scenarios


def rig_turns(count: int, given: str = "pairs", seed: int = 8) -> list[Scenario]:
    """The rig itself turns to and fro by 15 degrees at 0.3 Hz: in its own frame, the resting target circles it."""
    scenarios = []
    for i in range(count):
        random = np.random.default_rng([seed, i])
        point, phase = _random_place(random), random.uniform(0, math.tau)

        def target(time_s: float, point: Array = point, phase: float = phase) -> Array:
            turn = math.radians(7.5) * (math.sin(math.tau * 0.3 * time_s + phase) - math.sin(phase))
            cosine, sine = math.cos(turn), math.sin(turn)
            return np.array([cosine * point[0] - sine * point[1], sine * point[0] + cosine * point[1], point[2]])

        scenarios.append(Scenario(target, fixating(point), 5.0, given, seed=1000 * seed + i))
    return scenarios


def at_distance(
    count: int, distance_m: float, encoder: Callable[[int], Encoder] | None = None, seed: int = 9
) -> list[Scenario]:
    """Targets at rest at one distance, with or without the visual encoder that is made for a run's seed."""
    scenarios = []
    for i in range(count):
        random = np.random.default_rng([seed, i])
        point = place(distance_m, math.radians(random.uniform(-30, 30)), math.radians(random.uniform(-15, 15)))
        start = in_view_start(point, random)
        run_seed = 1000 * seed + i
        reads = None if encoder is None else encoder(run_seed)
        scenarios.append(Scenario(still(point), start, 2.5, "pairs", seed=run_seed, encoder=reads))
    return scenarios


def _switch(before: Array, after: Array, at_s: float) -> Callable[[float], Array]:
    return lambda time_s: before if time_s < at_s else after
