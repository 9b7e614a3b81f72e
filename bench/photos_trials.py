"""One click on a photograph: where the eyes start, what plant turns them, and what came of it."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import cv2
import numpy as np

from bench.photos_data import Target, pair_of, photographs_rig
from bench.photos_lockstep import Lockstep, Trace, record
from vergence_rig.rig import JOINT_NAMES, Rig
from vergence_rig.servo import IDEAL
from vergence_sim.parameters import SimParameters
from vergence_sim.photo.joints import Plant
from vergence_sim.photo.pair import PhotoPair, PhotoPoint
from vergence_sim.photo.world import PhotoWorld

DURATION_S = 3.0
REST_S = 0.5
_AWAKE_S = 0.3
_IN_VIEW_PX = 24.0
_ASIDE_DEG, _VERGENCE_DEG = 0.35, 0.25
_FALSE_ASIDE_DEG, _FALSE_VERGENCE_DEG = 1.0, 0.5
_ZERO_RAD = math.radians(3.0)
_SPARE_VERGENCE_RAD = math.radians(0.5)


@dataclass(frozen=True)
class Outcome:
    """What came of a click: times in seconds, errors in degrees at the end; `declared_s` is inf if never."""

    target: Target
    setting: str
    declared_s: float
    falsely_verged: bool
    aside_deg: float
    vergence_deg: float
    time_ratio: float
    last_reason: str
    last_phase: str
    outside_share: float
    near_deg: float

    @property
    def declared(self) -> bool:
        """True if the eyes were ever declared verged."""
        return math.isfinite(self.declared_s)

    @property
    def on_target(self) -> bool:
        """True if they were, and rested on the point that was clicked."""
        return self.declared and self.aside_deg <= _ASIDE_DEG and self.vergence_deg <= _VERGENCE_DEG


def shipped_rig() -> Rig:
    """Return the rig as rig.yaml describes it."""
    return photographs_rig()


def ideal_rig() -> Rig:
    """Return a rig that is described with ideal servos."""
    return photographs_rig().with_servos(IDEAL)


PlantOf = Callable[[np.random.Generator, float, Rig], Plant]
"""A plant from a seeded generator, the vergence that the target needs [rad] and the rig."""


def _zero_off(random: np.random.Generator, vergence_rad: float, rig: Rig) -> Plant:
    """One joint's zero is 3 degrees off, to the other side where the limits would not let the eyes reach the target."""
    joint, zero = str(random.choice(JOINT_NAMES)), float(random.choice([-1.0, 1.0])) * _ZERO_RAD
    added = {"pan_left": -zero, "pan_right": zero, "tilt": 0.0}[joint]
    reachable = vergence_rad - added > rig.minimum_vergence_rad + _SPARE_VERGENCE_RAD
    return Plant(zero_rad={joint: zero if reachable else -zero})


SETTINGS: dict[str, tuple[Callable[[], Rig], PlantOf]] = {
    "sg90": (shipped_rig, lambda *_: Plant()),
    "ideal": (ideal_rig, lambda *_: Plant()),
    "mismatch.ideal": (shipped_rig, lambda *_: Plant(servo=IDEAL)),
    "mismatch.deadband2x": (shipped_rig, lambda *_: Plant(dead_band_scale=2.0)),
    "mismatch.slow": (shipped_rig, lambda *_: Plant(speed_scale=0.7)),
    "mismatch.scale": (shipped_rig, lambda *_: Plant(angle_scale=1.06)),
    "mismatch.zero": (shipped_rig, _zero_off),
}
"""By name: the rig that metric and controller are given, and the plant that really turns the eyes."""


@dataclass(frozen=True)
class Trial:
    """A click on a target under a setting; `seed` draws noise, the start in the servos' play and the moment."""

    target: Target
    setting: str = "sg90"
    seed: int = 0
    imperfect: bool = True


def run(trial: Trial) -> Outcome:
    """Run a trial."""
    trace, rig = trace_of(trial)
    return outcome_of(trial, trace, rig)


def trace_of(trial: Trial) -> tuple[Trace, Rig]:
    """Run a trial and return its trace and the rig that was described."""
    cv2.setNumThreads(1)
    described, plant_of = SETTINGS[trial.setting]
    rig, pair, point = described(), pair_of(trial.target.pair), trial.target.point
    random = np.random.default_rng([trial.seed, 20])
    fixation = pair.fixation(point)
    plant = plant_of(random, fixation.vergence_rad, rig)
    values = {"seed": trial.seed}
    parameters = SimParameters.of(values) if trial.imperfect else SimParameters.ideal(values)
    world = PhotoWorld(pair, parameters, rig, plant)
    play = {name: plant.spec(joint.servo) for name, joint in rig.joints.items()}
    aside = {
        name: float(random.uniform(-0.5, 0.5)) * (servo.dead_band_rad + servo.backlash_rad)
        for name, servo in play.items()
    }
    world.head.place(start_of(world, pair, point), 0.0, aside)
    lockstep = Lockstep(world, rig)
    lockstep.advance_to(_AWAKE_S + float(random.uniform(0.0, 1.0 / parameters.camera.frame_rate_hz)))
    return record(lockstep, point, DURATION_S, REST_S), rig


def start_of(world: PhotoWorld, pair: PhotoPair, point: PhotoPoint) -> dict[str, float]:
    """Return straight ahead, or the pose next to it from which both eyes see the point.

    The right eye turns with the left one, so that the vergence at the start says nothing of the target.
    """
    camera, wanted = world.rig.left_camera, pair.fixation(point)
    # A zero that is off turns the eyes aside of what their driver reports.
    margin_px = _IN_VIEW_PX + camera.fx_px * max(map(abs, world.head.plant.zero_rad.values()), default=0.0)
    across = math.atan((0.5 * camera.width_px - margin_px) / camera.fx_px)
    down = math.atan((0.5 * camera.height_px - margin_px) / camera.fy_px)
    pans = wanted.pan_left_rad, wanted.pan_right_rad
    pan = min(max(0.0, max(pans) - across), min(pans) + across)
    tilt = min(max(0.0, wanted.tilt_rad - down), wanted.tilt_rad + down)
    return {"pan_left": pan, "pan_right": pan, "tilt": tilt}


def outcome_of(trial: Trial, trace: Trace, rig: Rig) -> Outcome:
    """Return what a trace shows."""
    verged, times = np.array(trace.verged), np.array(trace.time_s)
    aside, vergence = np.abs(trace.aside_deg), np.abs(trace.vergence_deg)
    declared = np.flatnonzero(verged)
    false = verged & ((aside > _FALSE_ASIDE_DEG) | (vergence > _FALSE_VERGENCE_DEG))
    target = trial.target
    fixation = pair_of(target.pair).fixation(target.point)
    return Outcome(
        target=target,
        setting=trial.setting,
        declared_s=float(times[declared[0]]) if declared.size else math.inf,
        falsely_verged=bool(false.any()),
        aside_deg=float(aside[-1]),
        vergence_deg=float(vergence[-1]),
        time_ratio=_arrived_s(trace, rig) / _bound_s(trace, rig),
        last_reason=trace.reason[-1],
        last_phase=trace.phase[-1],
        outside_share=trace.outside_share,
        near_deg=math.degrees(fixation.vergence_rad),
    )


def _arrived_s(trace: Trace, rig: Rig) -> float:
    """Return from when on all errors stay within the pan servos' dead band (0.25 degrees if they have none) [s]."""
    tolerance = math.degrees(rig.pan_left.servo.dead_band_rad) or 0.25
    outside = np.flatnonzero(trace.largest_deg > tolerance)
    if outside.size == 0:
        return trace.time_s[0]
    return math.inf if outside[-1] + 1 >= len(trace.time_s) else trace.time_s[outside[-1] + 1]


def _bound_s(trace: Trace, rig: Rig) -> float:
    """Return the soonest possible [s]: first result of a pair after the click, the servos' latency and travel."""
    vergence, version, tilt = trace.start_errors_rad
    ways = np.abs([version - 0.5 * vergence, version + 0.5 * vergence, tilt])
    servos = [joint.servo for _, joint in rig.joints.items()]
    travel_s = float((ways / [servo.speed_rad_s for servo in servos]).max())
    return trace.first_result_s + max(servo.command_latency_s for servo in servos) + travel_s


def with_setting(trial: Trial, setting: str) -> Trial:
    """Return the same click under another setting."""
    return replace(trial, setting=setting)
