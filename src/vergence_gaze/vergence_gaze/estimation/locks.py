"""Which track and which boxes belong to the target, and the target's offset from them.

The requested point may lie beside the middle of what is tracked or detected; that offset is kept.
"""

import math
from collections import deque

import numpy as np
import numpy.typing as npt

from vergence_gaze.estimation.target_filter import TargetEstimate

Array = npt.NDArray[np.float64]

_GATE_SIGMA = 4.0
_BOX_MARGIN_RAD = 0.01
_BOXES_TO_LEARN = 5
_LATER_SHARE = 0.01
_LONGEST_MEAN_OF_TRACK = 4
_SAME_PAIR_S = 0.012
_BESIDE_BOXES = 2
_NOWHERE: Array = np.full(3, math.nan)


class TrackLock:
    """The track that follows the target, with the target's offset (2,) from it in pan and tilt [rad]."""

    def __init__(self) -> None:
        self.track_id: int | None = None
        self.offset = np.zeros(2)
        self._rejected_id: int | None = None
        self._compared = self._beside = 0
        self._seen: deque[tuple[float, int, Array]] = deque(maxlen=30)

    def reject(self) -> None:
        """Release the track, which follows another object, and do not adopt it again."""
        self._rejected_id, self.track_id = self.track_id, None

    def adopt(
        self,
        track_id: int,
        seen_rad: Array,
        estimate: TargetEstimate,
        radius_rad: float,
        depth_margin_rad: float,
    ) -> str:
        """Adopt a track at `seen_rad` (left pan, right pan, tilt) as the target's; returns why not, or ""."""
        offset = (estimate.joints_rad - seen_rad)[[0, 2]]
        deeper = float(seen_rad[1] - seen_rad[0]) - estimate.vergence_rad
        vergence_off_rad = deeper if math.isfinite(deeper) else 0.0
        distance = float(np.hypot(*offset))
        if track_id == self._rejected_id:
            return "the tracker follows an object that, by the boxes, is not the target"
        if distance > radius_rad:
            return f"the tracker follows an object {math.degrees(distance):.1f} deg away from the target"
        if abs(vergence_off_rad) > _GATE_SIGMA * float(estimate.sigmas_rad[1]) + depth_margin_rad:
            deeper_deg = math.degrees(vergence_off_rad)
            return f"the tracker follows an object whose vergence is {deeper_deg:.1f} deg off the target's"
        # The first lock after a click keeps the click. A tracker that did not lock again because the move was small
        # still follows its old target next to it.
        first = self.track_id is None
        self.offset, self._compared = (offset, 1) if first else (np.zeros(2), 0)
        self.track_id = track_id
        return ""

    def adopt_requested(self, track_id: int, is_answer: bool) -> str:
        """Adopt the track that answers the request for the target; returns why not, or ""."""
        if not is_answer:
            return "the tracker has not found the requested target yet"
        self.track_id, self.offset = track_id, np.zeros(2)
        return ""

    def add(self, stamp_s: float, track_id: int, seen_rad: Array) -> None:
        """Keep where a track was, at `seen_rad` (left pan, right pan, tilt), to compare with slower boxes."""
        self._seen.append((stamp_s, track_id, seen_rad))

    def place_at(self, stamp_s: float) -> Array | None:
        """Return pan and tilt (2,) of the target in a pair by its track; None without one."""
        track_id, seen_rad = self._in_pair(stamp_s)
        return seen_rad[[0, 2]] + self.offset if track_id is not None and track_id == self.track_id else None

    def _in_pair(self, stamp_s: float) -> tuple[int | None, Array]:
        same = [(track_id, seen) for seen_s, track_id, seen in self._seen if abs(seen_s - stamp_s) < _SAME_PAIR_S]
        return same[-1] if same else (None, _NOWHERE)

    def correct_offset(self, stamp_s: float, target_rad: Array) -> None:
        """Correct the offset by the target's place (left pan, right pan, tilt) in the boxes of a pair.

        A track slips along its object, and may have locked on beside it; boxes always surround the same object.
        """
        place = self.place_at(stamp_s)
        if place is None or not np.isfinite(target_rad[[0, 2]]).all():
            return
        self._compared = min(self._compared + 1, _LONGEST_MEAN_OF_TRACK)
        self.offset = self.offset + (target_rad[[0, 2]] - place) / self._compared

    def adopt_by_class(
        self, stamp_s: float, estimate: TargetEstimate, target_rad: Array, extent_rad: float, depth_margin_rad: float
    ) -> None:
        """Adopt the track that follows the same object as boxes of the requested class in one pair.

        Args:
            stamp_s: of the pair.
            estimate: of the target then, with these boxes and all before them.
            target_rad: (left pan, right pan, tilt) (3,) of the boxes' middles; NaN where one eye has none.
            extent_rad: how wide the boxes are.
            depth_margin_rad: by how much vergence may differ over the object.
        """
        track_id, seen_rad = self._in_pair(stamp_s)
        if track_id in (None, self.track_id, self._rejected_id):
            return
        if _is_within(seen_rad[[0, 2]], seen_rad, target_rad, extent_rad, depth_margin_rad):
            self.track_id, self.offset, self._compared = track_id, (estimate.joints_rad - seen_rad)[[0, 2]], 2
            self._beside = 0

    def correct_offset_by_class(
        self, stamp_s: float, target_rad: Array, extent_rad: float, depth_margin_rad: float
    ) -> bool:
        """Correct the offset by boxes of the requested class; False once two in a row contradict the track.

        Arguments as in `adopt_by_class`.
        """
        place, (_, seen_rad) = self.place_at(stamp_s), self._in_pair(stamp_s)
        if place is None or not np.isfinite([*target_rad[[0, 2]], extent_rad]).all():
            return True
        if _is_within(place, seen_rad, target_rad, extent_rad, depth_margin_rad):
            self._beside = 0
            self.correct_offset(stamp_s, target_rad)
        else:
            self._beside += 1
        return self._beside < _BESIDE_BOXES


class BoxLock:
    """The boxes that contain a target that was not requested by its class."""

    def __init__(self) -> None:
        self.release()

    def release(self) -> None:
        """Release the boxes, which are another object's."""
        self.adopted = False
        self.offset = np.zeros(2)
        self._learnt = 0

    def adopt(self, seen_rad: Array, extent_rad: float, vergence_bound_rad: float, estimate: TargetEstimate) -> bool:
        """Return whether boxes with middles at `seen_rad` (left pan, right pan, tilt) are the target's.

        The first of them give its offset from their middles. A single box is assumed to be as wide as high.
        """
        off = estimate.joints_rad - seen_rad
        pan_off = off[0] if math.isfinite(off[0]) else off[1]
        beside = np.array([pan_off, off[2]])
        half = 0.5 * min(max(extent_rad, 0.0), 1.0) if math.isfinite(extent_rad) else 0.0
        sigma = float(max(estimate.sigmas_rad[0], estimate.sigmas_rad[2]))
        deeper = abs(float(off[1] - off[0]))
        if not np.abs(beside).max() <= half + _BOX_MARGIN_RAD + min(sigma, half) or deeper > vergence_bound_rad:
            self.release()
            return False
        if not self.adopted:
            self.adopted = True
            self._learn(beside)
        return True

    def correct_offset(self, seen_rad: Array, place_rad: Array | None) -> None:
        """Correct the offset from boxes with middles at `seen_rad` by the target's pan and tilt (2,) in its track.

        Only by that: from boxes alone the offset of a moving target would grow and grow. The requested point is known
        best at first; later a track that slips is corrected by the boxes.
        """
        if place_rad is not None and np.isfinite(seen_rad[[0, 2]]).all():
            self._learn(place_rad - seen_rad[[0, 2]])

    def _learn(self, beside: Array) -> None:
        self._learnt += 1
        share = 1.0 / self._learnt if self._learnt <= _BOXES_TO_LEARN else _LATER_SHARE
        self.offset = self.offset + share * (beside - self.offset)


def _is_within(
    place_rad: Array, seen_rad: Array, target_rad: Array, extent_rad: float, depth_margin_rad: float
) -> bool:
    """Return whether what is at pan and tilt (2,) and seen at (3,) may be the object in the boxes."""
    beside = float(np.abs(place_rad - target_rad[[0, 2]]).max())
    deeper = abs(float((seen_rad[1] - seen_rad[0]) - (target_rad[1] - target_rad[0])))
    return beside <= 0.5 * extent_rad + _BOX_MARGIN_RAD and not deeper > depth_margin_rad
