"""A detected class as target: when to ask the tracker for what its boxes show."""

import difflib
import math
from dataclasses import replace

from vergence_gaze.estimation.observations import BoxSighting
from vergence_gaze.goals.goal import Goal, GoalError, GoalKind, Outcome, Result, TrackRequest
from vergence_rig.face_model import FACE_CLASS, FACE_HINT
from vergence_rig.parameters import shown as shown_value

_SHOWN = 20


def check_class(goal: Goal, classes: tuple[str, ...] | None) -> None:
    """Raise GoalError for a class that the detector does not look for; None: which it looks for is not known."""
    if goal.kind is not GoalKind.CLASS or classes is None or goal.class_name in classes:
        return
    close = difflib.get_close_matches(goal.class_name, classes, n=1)
    others = [name for name in classes if name not in close][: _SHOWN - len(close)]
    shown = ", ".join([*close, *others]) + (", ..." if len(classes) > _SHOWN else "")
    got = shown_value(goal.class_name)
    text = f"class_name must be one that the detector looks for ({shown}): got {got}"
    raise GoalError(Result.INVALID, text + _face_hint(goal.class_name))


def with_detector(outcome: Outcome, class_name: str, classes: tuple[str, ...] | None) -> Outcome:
    """Return how a goal for a class ended, with what is missing where no detector has said which classes it finds."""
    if outcome.result is Result.VERGED or classes is not None:
        return outcome
    missing = "no classes of a detector have arrived (vergence/detector_classes): box_metric_node must run"
    return replace(outcome, reason=f"{outcome.reason}; {missing}{_face_hint(class_name)}")


def _face_hint(class_name: str) -> str:
    return f"; {FACE_HINT}" if class_name == FACE_CLASS else ""


class RequestedClass:
    """Asks the tracker for the object in boxes that count because the tracker does not show it.

    Args:
        goal_id: of the goal.
        again_after_s: time after which the tracker is asked again if boxes still count.
    """

    def __init__(self, goal_id: int, again_after_s: float) -> None:
        self.goal_id, self._again_after_s = goal_id, again_after_s
        self._asked_s = -math.inf

    def request(self, box: BoxSighting, now_s: float) -> TrackRequest | None:
        """Return what to ask the tracker now that a box counts: its middle and size, in the left image of its pair."""
        angles_rad = (box.left_azimuth_rad, box.left_elevation_rad)
        sized = box.whole and math.isfinite(sum(angles_rad)) and min(box.extent_rad, box.extent_height_rad) > 0.0
        if not sized or now_s - self._asked_s < self._again_after_s:
            return None
        self._asked_s = now_s
        x, y = (math.tan(angle) for angle in angles_rad)
        return TrackRequest(self.goal_id, box.stamp_s, True, (x, y), (box.extent_rad, box.extent_height_rad))
