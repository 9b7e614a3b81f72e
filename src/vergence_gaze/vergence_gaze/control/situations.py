"""What the phases and the active goal need to know of a control cycle, gathered from what perceives and steers."""

import numpy as np
import numpy.typing as npt

from vergence_gaze.control.perception import Perception
from vergence_gaze.goals.goal_monitor import Progress
from vergence_gaze.joints.limits import CommandLimits
from vergence_gaze.laws.protocol import ControlInput, Law
from vergence_gaze.parameters import GazeParameters
from vergence_gaze.phases import Phase, PhaseMachine, Situation

Array = npt.NDArray[np.float64]


def situation_of(
    state: ControlInput,
    perception: Perception,
    phases: PhaseMachine,
    law: Law,
    limits: CommandLimits,
    parameters: GazeParameters,
    *,
    active: bool,
    attends_and_may_search: bool | None,
) -> Situation:
    """Return what the phases decide by; `attends_and_may_search` is None where it is not attention that looks."""
    tracking, residual = perception.tracking, np.zeros(3)
    has_target = tracking.filter.initialised
    if has_target:
        # Turning cannot reduce an error beyond the limits: it is no residual.
        reachable = limits.nearest(state.shaft_rad + law.residual(state))
        residual = np.where(state.driven, reachable - state.shaft_rad, 0.0)
    lost_s = state.now_s - phases.since_s if phases.phase is Phase.LOST else 0.0
    return Situation(
        now_s=state.now_s,
        active=active,
        has_target=has_target,
        unseen_s=perception.unseen_s(state.now_s),
        residual_rad=max(map(abs, residual.tolist())),
        eyes_still=perception.eyes_still(state.now_s, state.commanded_rad, law.lands_at_rest),
        travel_s=float((np.abs(residual) / state.speed_rad_s).max()),
        verged=perception.judge.verged,
        # Without images there is nothing to be found in them; a stream of points needs none. What moves is waited for:
        # eyes that turn see less of it.
        may_search=tracking.follows_stream
        or (
            not perception.images_missing(state.now_s)
            and not tracking.awaits_motion
            and (tracking.class_name is not None or lost_s > parameters.search.after_s)
            and attends_and_may_search is not False
        ),
    )


def progress_of(
    now_s: float, perception: Perception, phases: PhaseMachine, pose_reached: bool | None, beyond_limits: bool
) -> Progress:
    """Return what the active goal is judged by; `pose_reached` is None where no pose was asked for."""
    tracking, judge = perception.tracking, perception.judge
    return Progress(
        now_s=now_s,
        verged=judge.verged,
        verged_reason=judge.reason,
        tracking_note=tracking.note,
        phase=phases.phase,
        in_phase_s=now_s - phases.since_s,
        image_s=perception.image_s,
        beyond_limits=beyond_limits,
        by_class=tracking.class_name is not None,
        pose_reached=pose_reached,
        ambiguity=tracking.ambiguity,
        images_fault=perception.images_fault(now_s),
        at_point=point.reached(now_s) if (point := tracking.point) else "",
    )
