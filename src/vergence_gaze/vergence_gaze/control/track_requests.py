"""What is asked for: of the tracker a click, a point in space, what boxes show, or what the left eye looks at; of the
detector a class or an object.
"""

import math

import numpy as np

from vergence_gaze.control.perception import Perception
from vergence_gaze.estimation.directions import spread_of_eye
from vergence_gaze.goals.goal import ObjectRequest, TrackRequest
from vergence_gaze.parameters import GazeParameters

_STRAIGHT_AHEAD = (0.0, 0.0)


class TrackRequests:
    """Keeps the requests that the next command carries."""

    def __init__(self, perception: Perception, parameters: GazeParameters) -> None:
        self._perception, self._p = perception, parameters
        self._next: TrackRequest | None = None
        self._object, self._object_sent = ObjectRequest(), False

    def ask_object(self, request: ObjectRequest) -> None:
        """Ask the detector for this; it keeps to it until the next request."""
        self._object_sent = self._object_sent and request == self._object
        self._object = request

    def pop_object(self) -> ObjectRequest | None:
        """Return what the detector is to be asked for, None for no change."""
        request = None if self._object_sent else self._object
        self._object_sent = True
        return request

    def ask(self, request: TrackRequest) -> None:
        """Ask for this."""
        self._next = request

    def free(self) -> None:
        """Ask for nothing: the tracker may follow what lies at the fovea."""
        self._next = TrackRequest(0)

    def pop(self) -> TrackRequest | None:
        """Return and remove the request, None for no change."""
        request, self._next = self._next, None
        return self._perception.tracking.pop_track_request() or request

    def ask_at_point(self, resting: bool, now_s: float) -> None:
        """Ask for what lies at the requested point, once eyes that rest on it have been seen by an image."""
        point = self._perception.tracking.point
        if point is None:
            return
        stamp_s = self._resting_image_s()
        joints_rad = self._perception.history.shaft_at(stamp_s) if math.isfinite(stamp_s) else np.full(3, math.nan)
        self._next = point.request(resting, now_s, stamp_s, joints_rad) or self._next

    def ask_for_view(self, goal_id: int, now_s: float) -> bool:
        """Make what the newest image of resting eyes shows at the left fovea the target; False if there is none."""
        stamp_s, tracking = self._resting_image_s(), self._perception.tracking
        if not math.isfinite(stamp_s):
            return False
        left, right, tilt = self._perception.history.shaft_at(stamp_s)
        spread = spread_of_eye(True, self._p.target.direction_sigma_rad, self._p.target.prior_vergence_sigma_rad)
        tracking.request_target(now_s, stamp_s, np.array([0.5 * (left + right), right - left, tilt]), spread, goal_id)
        self._next = TrackRequest(goal_id, stamp_s, True, _STRAIGHT_AHEAD)
        return True

    def _resting_image_s(self) -> float:
        """Return the stamp of the newest image, NaN if the eyes turned in it or no joint report covers it."""
        stamp_s = self._perception.exposure_s
        return stamp_s if self._perception.tracking.eyes_were_still(stamp_s, 0.0) else math.nan
