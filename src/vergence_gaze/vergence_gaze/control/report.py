"""The controller's report of every cycle, as GazeState carries it."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
import numpy.typing as npt

from vergence_gaze.control.perception import Perception
from vergence_gaze.estimation.distance import TargetPosition
from vergence_gaze.estimation.target_estimate import TargetEstimate
from vergence_gaze.goals.goal import ObjectRequest, Outcome, TrackRequest
from vergence_gaze.phases import Phase, PhaseMachine
from vergence_rig.geometry import EyeAngles, GeometryError
from vergence_rig.kinematics import Kinematics
from vergence_rig.rig import Rig

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class GazeReport:
    """Angles are estimated, residuals (version, vergence, tilt) are what is left to turn; NaN where unknown.

    `fault` says what is wrong with the joints' feedback or the images, `images_missing` whether no results of images
    arrive. `attention` is its policy, what it attends to and why. Where target and fixation point are is computed when
    it is read: most cycles' reports have no reader.
    """

    stamp_s: float
    phase: Phase
    reason: str
    law: str
    mode: str
    verged: bool
    target_moving: bool
    version_rad: float
    vergence_rad: float
    tilt_rad: float
    residual_rad: tuple[float, float, float]
    residual_px: float
    contrast: float
    locate_target: Callable[[], TargetPosition]
    locate_fixation: Callable[[], tuple[Array, float]]
    fault: str = ""
    images_missing: bool = False
    attention: str = ""

    @cached_property
    def target(self) -> TargetPosition:
        """The target's position."""
        return self.locate_target()

    @property
    def fixation_m(self) -> Array:
        """The midpoint of the gaze rays' closest approach (3,) [m]."""
        return self._fixation[0]

    @property
    def miss_distance_m(self) -> float:
        """How far the gaze rays pass one another [m]."""
        return self._fixation[1]

    @cached_property
    def _fixation(self) -> tuple[Array, float]:
        return self.locate_fixation()


@dataclass(frozen=True)
class Command:
    """One cycle's result.

    Joint angles (3,) to send, or None; the report; the goals that ended; what the tracker is to follow from now on, and
    which object the detector is to measure, None for no change.
    """

    joints_rad: Array | None
    make_report: Callable[[], GazeReport]
    outcomes: tuple[Outcome, ...]
    track_request: TrackRequest | None = None
    object_request: ObjectRequest | None = None

    @cached_property
    def report(self) -> GazeReport:
        """The state after the cycle, made when it is first read, before the next cycle: most have no reader."""
        return self.make_report()


_CLAIM_S = 0.6  # without results of images, after which eyes are no longer said to be verged


def make_report(
    now_s: float,
    perception: Perception,
    phases: PhaseMachine,
    law: str,
    mode: str,
    rig: Rig,
    fault: str = "",
    attention: str = "",
    uses_images: bool = True,
) -> GazeReport:
    """Return the state at `now_s` under this law and mode; `fault` is that of the feedback or the images.

    `uses_images` says whether results of images are needed now.
    """
    known = perception.history.known and math.isfinite(now_s)
    joints = perception.history.shaft_rad if known else np.full(3, math.nan)
    estimate = perception.tracking.estimate(now_s) if known else None
    residual = residual_of(estimate, joints)
    images_missing = uses_images and perception.images_missing(now_s)
    reason = phases.reason if known else f"waiting: {fault}"
    if fault not in reason:
        reason = f"{reason}; {fault}"
    if images_missing and not fault and phases.phase in (Phase.LOST, Phase.SEARCH):
        reason = f"{reason}; no results from the images arrive"
    if phases.phase is Phase.VERGE and not perception.judge.verged:
        reason = f"{reason}; {perception.tracking.note or perception.judge.reason}"
    return GazeReport(
        stamp_s=perception.pair_s if math.isfinite(perception.pair_s) else now_s,
        phase=phases.phase,
        reason=reason,
        law=law,
        mode=mode,
        verged=perception.judge.verged and now_s - perception.image_s <= _CLAIM_S,
        target_moving=perception.tracking.filter.moving,
        version_rad=0.5 * float(joints[0] + joints[1]),
        vergence_rad=float(joints[1] - joints[0]),
        tilt_rad=float(joints[2]),
        residual_rad=residual,
        residual_px=disparity_px(residual[1], rig.left_camera.fx_px),
        contrast=perception.judge.contrast,
        locate_target=perception.position(estimate),
        locate_fixation=partial(fixation_of, joints, perception.kinematics),
        fault=fault,
        images_missing=images_missing,
        attention=attention,
    )


def residual_of(estimate: TargetEstimate | None, joints_rad: Array) -> tuple[float, float, float]:
    """Return version, vergence and tilt [rad] that are left to turn from these joint angles (3,); NaN if unknown."""
    if estimate is None:
        return math.nan, math.nan, math.nan
    version, vergence = 0.5 * float(joints_rad[0] + joints_rad[1]), float(joints_rad[1] - joints_rad[0])
    return estimate.version_rad - version, estimate.vergence_rad - vergence, estimate.tilt_rad - float(joints_rad[2])


def disparity_px(vergence_residual_rad: float, focal_px: float) -> float:
    """Return the horizontal disparity [px] that a vergence residual shows as at the fovea; NaN for NaN."""
    if not abs(vergence_residual_rad) < 1.5:
        return math.nan
    return focal_px * math.tan(vergence_residual_rad)


def fixation_of(angles_rad: Array, kinematics: Kinematics) -> tuple[Array, float]:
    """Return where the axes at these eye angles (3,) meet, (3,) [m], and their miss distance; NaN if nowhere."""
    if not np.isfinite(angles_rad).all():
        return np.full(3, math.nan), math.nan
    left, right, tilt = (float(angle) for angle in angles_rad)
    try:
        fixation = kinematics.fixation(EyeAngles(left, right, tilt))
    except GeometryError:
        return np.full(3, math.nan), math.nan
    return fixation.point_m, fixation.miss_distance_m
