"""How much play each joint really has, from what the eyes see of its reversals.

A servo that reverses first crosses its dead band and backlash: the image moves by less than the command did, and what
is missing is the play. rig.yaml's figure comes from a data sheet; a wrong one makes the eyes land beside the target, or
swing about it for ever.

All of the play is crossed only by a shaft that rests at its other end. So the joints' whole way is followed, not only
what is between two sights: a saccade that turned back a little at its end has left its shaft anywhere in the play.
"""

import math
from collections import deque
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

_SMALLEST_MOVE_RAD = 1e-4
_LONGEST_GAP_S = 1.0  # between two sights of the target that are compared
_UNMOVED_RAD = 0.002  # an image that moves by less stands still, within its noise
_MOST_TIMES, _LEAST_LIMIT_RAD = 3.0, 0.02  # more than this many times as described, or than this, is no play


@dataclass
class _Joint:
    """A joint's way since the target was last seen.

    `side` is the end of the play at which the shaft rests, -1 or 1, 0 if it is not known; `lost_rad` is how far the
    joint has turned from there without moving the eye.
    """

    side: int = 0
    lost_rad: float = 0.0
    direction: int = 0
    way_rad: float = 0.0
    reversed: bool = False
    seen_s: float = math.nan
    seen_error_rad: float = math.nan

    @property
    def moved(self) -> bool:
        """True if it has turned since the target was last seen."""
        return self.way_rad > _SMALLEST_MOVE_RAD or self.reversed

    def turn(self, step_rad: float, play_rad: float) -> None:
        """Go on by a step of the reported angle."""
        direction = int(np.sign(step_rad))
        if direction == -self.direction:
            self.pass_unseen(play_rad)
            self.reversed, self.way_rad = True, 0.0
        if direction:
            self.direction = direction
            self.way_rad += abs(step_rad)

    def pass_unseen(self, play_rad: float) -> None:
        """Conclude from a way that was not seen where in the play the shaft rests."""
        if self.side == self.direction:
            self.lost_rad = max(0.0, self.lost_rad - self.way_rad)
        elif self.way_rad > _SMALLEST_MOVE_RAD:
            self.side, self.lost_rad = (self.direction if self.way_rad > play_rad else 0), 0.0

    def see(self, stamp_s: float, error_rad: float) -> None:
        """Begin a new way from here."""
        self.seen_s, self.seen_error_rad = stamp_s, error_rad
        self.direction, self.way_rad, self.reversed = 0, 0.0, False


class PlayEstimator:
    """Half of each joint's play (3,) [rad], at first as described.

    `learning_share` is the share of an observed difference that is taken over at once; 0 keeps the description.
    """

    def __init__(self, described_half_play_rad: Array, learning_share: float) -> None:
        self.half_play_rad: Array = described_half_play_rad.copy()
        """Another array whenever it changes."""
        # A target that sets off is taken for lost motion once, before it is known to move.
        self._most_rad = np.maximum(_MOST_TIMES * described_half_play_rad, _LEAST_LIMIT_RAD)
        self.learning_share = learning_share
        self._reports: deque[tuple[float, Array]] = deque()
        self._target_rests = True
        self.forget_way()

    def restart(self) -> None:
        """Drop the last observation: the next one is of another target."""
        for joint in self._joints:
            joint.seen_s = math.nan
        self._target_rests = True

    def forget_way(self) -> None:
        """Forget where the joints have been: the clock was set, or they were turned by something else."""
        self._joints = [_Joint() for _ in range(3)]
        self._reports.clear()
        self._reported_rad: Array | None = None

    def follow(self, stamp_s: float, reported_rad: Array) -> None:
        """Note the next reported angles (3,). They count once an image that was exposed later is seen, or cannot be."""
        self._reports.append((stamp_s, reported_rad))
        self._turn_until(stamp_s - _LONGEST_GAP_S)

    def _turn_until(self, stamp_s: float) -> None:
        while self._reports and self._reports[0][0] <= stamp_s:
            _, reported_rad = self._reports.popleft()
            if self._reported_rad is not None:
                steps, plays = (reported_rad - self._reported_rad).tolist(), (2.0 * self.half_play_rad).tolist()
                for joint, step_rad, play_rad in zip(self._joints, steps, plays, strict=True):
                    if step_rad:
                        joint.turn(step_rad, play_rad)
            self._reported_rad = reported_rad

    def observe(self, stamp_s: float, error_rad: Array) -> None:
        """Update by the same target, seen once more with eyes at rest.

        Whether the target rests is seen while the eyes do: the estimate of its motion is no evidence, because play that
        is not as described looks like motion.

        Args:
            stamp_s: of the exposure; what was seen too long before may be of a target that has moved since.
            error_rad: by how much each joint's axis was off the target in the image (3,), NaN where it was not seen.
        """
        self._turn_until(stamp_s)
        seen = [joint.seen_error_rad - error for joint, error in zip(self._joints, error_rad.tolist(), strict=True)]
        known = [
            stamp_s - joint.seen_s < _LONGEST_GAP_S and math.isfinite(value)
            for joint, value in zip(self._joints, seen, strict=True)
        ]
        if any(known) and not any(joint.moved for joint in self._joints):
            unmoved = (abs(value) < _UNMOVED_RAD for value, is_known in zip(seen, known, strict=True) if is_known)
            self._target_rests = all(unmoved)
        for i, joint in enumerate(self._joints):
            if not math.isfinite(error_rad[i]):
                continue
            if joint.moved and known[i] and self._target_rests and not joint.reversed:
                self._observe_move(i, joint, joint.direction * seen[i])
            elif joint.moved:
                joint.pass_unseen(2.0 * float(self.half_play_rad[i]))
            joint.see(stamp_s, float(error_rad[i]))

    def _observe_move(self, i: int, joint: _Joint, seen_rad: float) -> None:
        if joint.side == joint.direction:
            joint.lost_rad = max(0.0, joint.lost_rad - joint.way_rad)
        elif joint.side == -joint.direction:
            way_rad = joint.lost_rad + joint.way_rad
            lost_rad = min(max(way_rad - seen_rad, 0.0), way_rad)
            crossed = way_rad - lost_rad >= _UNMOVED_RAD
            joint.side, joint.lost_rad = (joint.direction, 0.0) if crossed else (joint.side, way_rad)
            # Where nothing of the way was seen the play is at least that.
            self._learn(i, lost_rad if crossed else max(lost_rad, 2.0 * float(self.half_play_rad[i])))
        elif seen_rad >= _UNMOVED_RAD:
            joint.side = joint.direction

    def _learn(self, i: int, play_rad: float) -> None:
        half_rad = float(self.half_play_rad[i])
        half_rad += self.learning_share * (0.5 * play_rad - half_rad)
        self.half_play_rad = self.half_play_rad.copy()
        self.half_play_rad[i] = min(half_rad, float(self._most_rad[i]))
