"""The uncertainty that the joints' moves add to the estimate of their angles."""

from collections import deque

import numpy as np
import numpy.typing as npt

from vergence_gaze.joints.resolution import pulse_steps_rad
from vergence_gaze.joints.shaft_history import ShaftHistory
from vergence_rig.rig import Rig

Array = npt.NDArray[np.float64]

_MOVE_VARIANCE_RAD = 8e-3
_TURN_SHARE = 0.35
_FIRST_SHARE = 0.6


class JointMoves:
    """Collects variances (3,) [rad^2] of moves with their stamps, until an image exposed after them arrives.

    A joint that turns round crosses its play, and one that moves ends anywhere between two of its driver's steps.
    """

    def __init__(self, rig: Rig, history: ShaftHistory) -> None:
        self._history = history
        self._last_reported: Array | None = None
        self._last_direction = np.zeros(3)
        self._moves: deque[tuple[float, Array]] = deque(maxlen=200)
        self.steps_rad = pulse_steps_rad(rig)
        """The joints' smallest steps (3,) [rad]."""

    def update(self) -> bool:
        """Read the newest report of the history; returns True if a pan has moved since the one before."""
        reported = self._history.reported_rad
        if self._last_reported is None:
            self._last_reported = reported
            return True
        move = reported - self._last_reported
        if not np.any(move):
            return False
        self._last_reported = reported
        half_play = self._history.half_play_rad
        direction = np.sign(move)
        turned = (direction != 0) & (direction != self._last_direction)
        # Before its first move a shaft may lie anywhere in its play.
        share = np.where(self._last_direction == 0, _FIRST_SHARE, _TURN_SHARE)
        self._last_direction = np.where(direction != 0, direction, self._last_direction)
        variances = _MOVE_VARIANCE_RAD * half_play * np.abs(move) + turned * (share * half_play) ** 2
        variances += np.minimum(np.abs(move), self.steps_rad) * self.steps_rad / 6.0
        if np.any(variances):
            self._moves.append((self._history.newest_s, variances))
        return bool(np.any(move[:2]))

    def variances_before(self, stamp_s: float) -> Array:
        """Return the sum (3,) of the variances that `pop_before` would return."""
        waiting = [variances for moved_s, variances in self._moves if moved_s <= stamp_s]
        return np.sum(waiting, axis=0) if waiting else np.zeros(3)

    def pop_before(self, stamp_s: float) -> list[Array]:
        """Return and remove the variances (3,) of moves before an exposure: earlier images do not show those moves."""
        popped = []
        while self._moves and self._moves[0][0] <= stamp_s:
            popped.append(self._moves.popleft()[1])
        return popped
