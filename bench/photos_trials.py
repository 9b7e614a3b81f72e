"""One click on a photograph: where the eyes start, what plant turns them, and what came of it."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np

from bench.heads import joints_of, simulated
from bench.photos_data import VIEW_PX, Target, pair_of, photographs_rig
from bench.photos_lockstep import Lockstep, Trace, record
from bench.photos_verdict import DURATION_S, REST_S, Verdict, verdict_of
from vergence_rig.rig import JOINT_NAMES, Joints, Rig
from vergence_rig.servo import IDEAL
from vergence_sim.heads import ideal_head
from vergence_sim.parameters import SimParameters
from vergence_sim.photo.pair import PhotoPair, PhotoPoint
from vergence_sim.photo.parameters import PlantParameters
from vergence_sim.photo.world import PhotoWorld, cropped
from vergence_sim.world import EYES

AWAKE_S = 0.3
_IN_VIEW_PX = 24.0
_ZERO_RAD = math.radians(3.0)
_SPARE_VERGENCE_RAD = math.radians(0.5)


@dataclass(frozen=True)
class Outcome(Verdict):
    """What came of a click on a photograph; `near_deg` is the vergence that the target needs."""

    target: Target
    setting: str
    outside_share: float
    near_deg: float


def shipped_rig() -> Rig:
    """Return the rig as rig.yaml describes it."""
    return photographs_rig()


def ideal_rig() -> Rig:
    """Return a rig that is described with ideal servos."""
    return photographs_rig().with_servos(IDEAL)


HeadOf = Callable[[Rig, np.random.Generator, float], Rig]
"""The head that really turns, from the one that is described, a seeded generator and the vergence needed [rad]."""


def _zero_off(head: Rig, random: np.random.Generator, vergence_rad: float) -> Rig:
    """One joint's zero is 3 degrees off, to the other side where the limits would not let the eyes reach the target."""
    joint, zero = str(random.choice(JOINT_NAMES)), float(random.choice([-1.0, 1.0])) * _ZERO_RAD
    added = {"pan_left": -zero, "pan_right": zero, "tilt": 0.0}[joint]
    reachable = vergence_rad - added > head.minimum_vergence_rad + _SPARE_VERGENCE_RAD
    return _turning(head, {joint: zero if reachable else -zero})


def _turning(head: Rig, zeros_rad: Mapping[str, float], scale: float = 1.0) -> Rig:
    """Return a head whose joints' zeros are this much more, and whose scales are multiplied."""
    joints = (
        replace(joint, zero_rad=joint.zero_rad + zeros_rad.get(name, 0.0), scale=scale * joint.scale)
        for name, joint in head.joints.items()
    )
    return replace(head, joints=Joints(*joints))


def _fitted(**servos: Any) -> HeadOf:
    plant = PlantParameters(**servos)
    return lambda head, *_: plant.fitted(head)


SETTINGS: dict[str, tuple[Callable[[], Rig], HeadOf]] = {
    "sg90": (shipped_rig, _fitted()),
    "ideal": (ideal_rig, _fitted()),
    "mismatch.ideal": (shipped_rig, _fitted(servo="ideal")),
    "mismatch.deadband2x": (shipped_rig, _fitted(dead_band_scale=2.0)),
    "mismatch.slow": (shipped_rig, _fitted(speed_scale=0.7)),
    "mismatch.scale": (shipped_rig, lambda head, *_: _turning(head, {}, 1.06)),
    "mismatch.zero": (shipped_rig, _zero_off),
}
"""By name: the servos that metric and controller are given, and the head that really turns."""


@dataclass(frozen=True)
class Trial:
    """A click on a target under a setting; `seed` draws noise, the start in the servos' play and the moment."""

    target: Target
    setting: str = "sg90"
    seed: int = 0
    imperfect: bool = True


def run(trial: Trial, make_lockstep: Callable[[PhotoWorld, Rig], Lockstep] = Lockstep) -> Outcome:
    """Run a trial."""
    trace, rig, outside_share = trace_of(trial, make_lockstep)
    return outcome_of(trial, trace, rig, outside_share)


def trace_of(trial: Trial, make_lockstep: Callable[[PhotoWorld, Rig], Lockstep] = Lockstep) -> tuple[Trace, Rig, float]:
    """Run a trial and return its trace, the rig that was described, and the share of padding in the view at the end."""
    cv2.setNumThreads(1)
    base_of, head_of = SETTINGS[trial.setting]
    base, pair, point = base_of(), pair_of(trial.target.pair), trial.target.point
    random = np.random.default_rng([trial.seed, 20])
    values = {"seed": trial.seed}
    parameters = SimParameters.of(values) if trial.imperfect else SimParameters.ideal(values)
    ideal = parameters.head.model == "ideal"
    rig = ideal_head(base) if ideal else cropped(simulated(base), *VIEW_PX)
    head = head_of(rig, random, pair.fixation(point).vergence_rad)
    world = PhotoWorld(pair, parameters, rig, head)
    aside = {
        name: float(random.uniform(-0.5, 0.5)) * (joint.servo.dead_band_rad + joint.servo.backlash_rad)
        for name, joint in head.joints.items()
    }
    world.head.place(start_of(world, pair, point), 0.0, aside)
    lockstep = make_lockstep(world, rig)
    lockstep.advance_to(AWAKE_S + float(random.uniform(0.0, 1.0 / parameters.camera.frame_rate_hz)))
    trace = record(lockstep, PointOfPhotograph(world, point), DURATION_S, REST_S)
    return trace, rig, max(world.outside_share(eye) for eye in EYES)


class PointOfPhotograph:
    """A point of the photographs, to click on."""

    def __init__(self, world: PhotoWorld, point: PhotoPoint) -> None:
        self._world, self._point = world, point

    def left_pixel(self) -> tuple[float, float]:
        """See `Clickable`."""
        return self._world.project("left", self._point)

    def errors_rad(self) -> tuple[float, float, float]:
        """See `Clickable`."""
        return self._world.errors_to(self._point)


def start_of(world: PhotoWorld, pair: PhotoPair, point: PhotoPoint) -> dict[str, float]:
    """Return the pose, by joint name, from which the eyes begin."""
    head = world.head.real
    # The image's middle need not be the eye's axis.
    camera = head.left_camera
    off_px = max(abs(camera.cx_px - 0.5 * (camera.width_px - 1)), abs(camera.cy_px - 0.5 * (camera.height_px - 1)))
    eyes = pair.start_towards(point, camera, _IN_VIEW_PX + off_px, head.mean_pitch_rad)
    return joints_of(head, eyes)


def outcome_of(trial: Trial, trace: Trace, rig: Rig, outside_share: float) -> Outcome:
    """Return what a trace shows; `outside_share` is that of the worse view at its end."""
    target = trial.target
    fixation = pair_of(target.pair).fixation(target.point)
    return Outcome(
        **vars(verdict_of(trace, rig)),
        target=target,
        setting=trial.setting,
        outside_share=outside_share,
        near_deg=math.degrees(fixation.vergence_rad),
    )


def with_setting(trial: Trial, setting: str) -> Trial:
    """Return the same click under another setting."""
    return replace(trial, setting=setting)
