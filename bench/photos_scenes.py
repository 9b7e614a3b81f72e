"""Clicks on a pen and on thin things in the rendered room: where they stand, how wide they are seen, what came of it.

The metric and the controller run as before photographs. The truth is the simulator's own kinematics, and the point that
is clicked is where the ray between the eyes through the middle of the thing meets its surface.
"""

import math
from collections.abc import Iterable, Sequence
from contextlib import closing
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from bench.gaze_scenarios import in_view_start, place
from bench.heads import identified, joints_of, simulated
from bench.photos_lockstep import Lockstep, record
from bench.photos_trials import AWAKE_S
from bench.photos_verdict import DURATION_S, REST_S, Verdict, verdict_of
from bench.results import Row
from vergence_rig.rig import JOINT_NAMES, default_rig
from vergence_sim.parameters import SimParameters
from vergence_sim.scene import MARKER_RADIUS_M, THIN_WIDTHS_M
from vergence_sim.simulator import Simulator

Array = npt.NDArray[np.float64]

MARKER, THIN = "marker", "thin"
ROOMS = range(8)
NEAREST_M, FARTHEST_M = 0.4, 1.5
NARROWEST_PX, WIDEST_PX = 5.0, 15.0
WIDTHS_M = {**THIN_WIDTHS_M, "marker": 2 * MARKER_RADIUS_M}
CLICKS_OF_A_ROOM = {MARKER: 3, THIN: 3}
_AZIMUTH_RAD, _ELEVATION_RAD = math.radians(25.0), math.radians(12.0)
_SETTLED_S = 1.0
_COMING_FROM_RAD = math.radians(4.0)


@dataclass(frozen=True)
class SceneTrial:
    """A click on a thing, "marker" or one of THIN_WIDTHS_M, whose centre stands at `centre_m` (3,) in rig_base.

    `kind` is MARKER or THIN, `room` the seed of the room; `seed` draws noise, the start and the moment of the click.
    """

    kind: str
    thing: str
    room: int
    centre_m: tuple[float, float, float]
    seed: int

    @property
    def distance_m(self) -> float:
        """From between the eyes to the centre."""
        return float(np.linalg.norm(self.centre_m))

    @property
    def width_px(self) -> float:
        """How wide the thing is in the images."""
        return default_rig().left_camera.fx_px * WIDTHS_M[self.thing] / self.distance_m


@dataclass(frozen=True)
class SceneOutcome(Verdict):
    """What came of a click in the room."""

    trial: SceneTrial


class PointOfRoom:
    """A point (3,) [m] of the room in rig_base, to click on."""

    def __init__(self, simulator: Simulator, point_m: Array) -> None:
        self._simulator, self._point_m = simulator, point_m

    def left_pixel(self) -> tuple[float, float]:
        """See `Clickable`."""
        return self._simulator.lenses["left"].distorted(self._simulator.project("left", self._point_m))

    def errors_rad(self) -> tuple[float, float, float]:
        """See `Clickable`."""
        return self._simulator.errors_to(self._point_m)


def trials() -> list[SceneTrial]:
    """Return every click; those in one room stand together."""
    found: list[SceneTrial] = []
    for room in ROOMS:
        kinds = [kind for kind, clicks in CLICKS_OF_A_ROOM.items() for _ in range(clicks)]
        for number, kind in enumerate(kinds):
            seed = 100 * room + number
            random = np.random.default_rng([seed, 31])
            thing, distance_m = _marker(random) if kind == MARKER else _thin(random)
            azimuth, elevation = (float(random.uniform(-most, most)) for most in (_AZIMUTH_RAD, _ELEVATION_RAD))
            x, y, z = place(distance_m, azimuth, elevation).tolist()
            found.append(SceneTrial(kind, thing, room, (x, y, z), seed))
    return found


def run(trial: SceneTrial) -> SceneOutcome:
    """Run a trial."""
    cv2.setNumThreads(1)
    rig, head, random = identified(), simulated(default_rig()), np.random.default_rng([trial.seed, 32])
    parameters = SimParameters.of({"seed": trial.seed, "world.seed": trial.room, "head.camera_info": "none"})
    with closing(Simulator(parameters, rig, head=head)) as simulator:
        simulator.place_target(trial.thing, trial.centre_m)
        point_m = np.asarray(simulator.truth().target_point_m, np.float64)
        settle(simulator, joints_of(head, in_view_start(point_m, random)), random)
        lockstep = Lockstep(simulator, rig)
        moment_s = float(random.uniform(0.0, 1.0 / simulator.parameters.camera.frame_rate_hz))
        lockstep.advance_to(simulator.time_s + AWAKE_S + moment_s)
        trace = record(lockstep, PointOfRoom(simulator, point_m), DURATION_S, REST_S)
    return SceneOutcome(**vars(verdict_of(trace, rig)), trial=trial)


def settle(simulator: Simulator, pose_rad: dict[str, float], random: np.random.Generator) -> None:
    """Have the servos go to a pose by joint name [rad] from near by, so that each rests somewhere in its play."""
    away = {name: angle + float(random.uniform(-1.0, 1.0)) * _COMING_FROM_RAD for name, angle in pose_rad.items()}
    simulator.set_head({name: simulator.rig.joints[name].clamp(angle) for name, angle in away.items()})
    simulator.command({name: pose_rad[name] for name in JOINT_NAMES})
    simulator.advance(_SETTLED_S)


def rows(outcomes: Sequence[SceneOutcome]) -> list[Row]:
    """Return the rows: for each kind the share that was truly verged, and the share that was ever falsely verged."""
    found: list[Row] = []
    for kind in (MARKER, THIN):
        own = [outcome for outcome in outcomes if outcome.trial.kind == kind]
        unit = f"of {len(own)} clicks"
        found.append(Row(f"scene.{kind}", float(np.mean([o.on_target for o in own])), unit))
        found.append(Row(f"scene.{kind}.false", float(np.mean([o.falsely_verged for o in own])), unit))
    return found


def failures(outcomes: Iterable[SceneOutcome]) -> list[str]:
    """Return a line for every click that was not truly verged, or falsely verged, with the last reason."""
    lines = ["clicks in the room that were not truly verged, or falsely verged at some time:"]
    for outcome in outcomes:
        trial = outcome.trial
        if outcome.on_target and not outcome.falsely_verged:
            continue
        said = f"declared after {outcome.declared_s:.2f} s" if outcome.declared else "never declared"
        lines.append(
            f"  {trial.thing:<7}room {trial.room}, {trial.distance_m:.2f} m, {trial.width_px:4.1f} px: {said}, "
            f"{'FALSE, ' if outcome.falsely_verged else ''}{outcome.aside_deg:.2f} deg aside, "
            f"{outcome.vergence_deg:.2f} in vergence; {outcome.last_phase}: {outcome.last_reason}"
        )
    return lines


def _marker(random: np.random.Generator) -> tuple[str, float]:
    return "marker", _spread(random, NEAREST_M, FARTHEST_M)


def _thin(random: np.random.Generator) -> tuple[str, float]:
    """Return a thing and its distance [m]: its width in px is drawn, and one that has it within reach."""
    size_px_m = default_rig().left_camera.fx_px / random.uniform(NARROWEST_PX, WIDEST_PX)
    distances = {thing: size_px_m * width for thing, width in THIN_WIDTHS_M.items()}
    things = [thing for thing, distance in distances.items() if NEAREST_M <= distance <= FARTHEST_M]
    thing = things[int(random.integers(len(things)))]
    return thing, distances[thing]


def _spread(random: np.random.Generator, low: float, high: float) -> float:
    """Return a value drawn evenly in its logarithm."""
    return float(math.exp(random.uniform(math.log(low), math.log(high))))
