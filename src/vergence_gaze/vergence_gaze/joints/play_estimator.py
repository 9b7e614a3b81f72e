"""How much play each joint really has, from what the eyes see of its reversals.

A servo that reverses first crosses its dead band and backlash: the image moves by less than the command did, and what
is missing is the play. rig.yaml's figure comes from a data sheet; a wrong one makes the eyes land beside the target, or
swing about it for ever.
"""

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

_SMALLEST_MOVE_RAD = 1e-4
_LONGEST_GAP_S = 1.0  # between two sights of the target that are compared
_UNMOVED_RAD = 0.002  # an image that moves by less stands still, within its noise
_MOST_TIMES, _LEAST_LIMIT_RAD = 3.0, 0.02  # more than this many times as described, or than this, is no play


class PlayEstimator:
    """Half of each joint's play (3,) [rad], at first as described.

    `learning_share` is the share of an observed difference that is taken over at once; 0 keeps the description.
    """

    def __init__(self, described_half_play_rad: Array, learning_share: float) -> None:
        self.half_play_rad: Array = described_half_play_rad.copy()
        # A target that sets off is taken for lost motion once, before it is known to move.
        self._most_rad = np.maximum(_MOST_TIMES * described_half_play_rad, _LEAST_LIMIT_RAD)
        self.learning_share = learning_share
        self._direction = np.zeros(3)
        self.restart()

    def restart(self) -> None:
        """Drop the last observation: the next one is of another target."""
        self._before: tuple[float, Array, Array] | None = None
        self._target_rests = True

    def observe(self, stamp_s: float, reported_rad: Array, error_rad: Array) -> None:
        """Update by the same target, seen with resting eyes once more.

        Whether the target rests is seen while the eyes do: the estimate of its motion is no evidence, because play that
        is not as described looks like motion.

        Args:
            stamp_s: of the exposure; what was seen too long before may be of a target that has moved since.
            reported_rad: the joints as reported at the exposure (3,).
            error_rad: by how much each joint's axis was off the target in the image (3,), NaN where it was not seen.
        """
        if self._before is not None and stamp_s - self._before[0] < _LONGEST_GAP_S:
            moves = reported_rad - self._before[1]
            seen = self._before[2] - error_rad
            known, moved = np.isfinite(seen), np.abs(moves) > _SMALLEST_MOVE_RAD
            if known.any() and not moved.any():
                self._target_rests = bool(np.abs(seen[known]).max() < _UNMOVED_RAD)
            for i in np.flatnonzero(known & moved if self._target_rests else []):
                self._observe_move(int(i), float(moves[i]), float(seen[i]))
        self._before = stamp_s, reported_rad.copy(), error_rad.copy()

    def _observe_move(self, i: int, move_rad: float, seen_rad: float) -> None:
        direction = 1.0 if move_rad > 0 else -1.0
        reversed_ = self._direction[i] == -direction
        self._direction[i] = direction
        if not reversed_:
            return
        way_rad = abs(move_rad)
        lost_rad = min(max(way_rad - direction * seen_rad, 0.0), way_rad)
        if way_rad - lost_rad < _UNMOVED_RAD:
            # All of the move was lost: the play is at least that.
            lost_rad = max(lost_rad, 2.0 * float(self.half_play_rad[i]))
        half_rad = float(self.half_play_rad[i])
        half_rad += self.learning_share * (0.5 * lost_rad - half_rad)
        self.half_play_rad[i] = min(half_rad, float(self._most_rad[i]))
