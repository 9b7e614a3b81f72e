"""What the turning of the eyes does to tracking: when it is a saccade, when they rest, where pixels go."""

import math
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from vergence_metric.disparity.parameters import TrackerParameters
from vergence_rig.camera import CameraModel
from vergence_rig.geometry import EyeAngles, rotation_rig_from_optical

Pixel = tuple[float, float]


Told = tuple[float, EyeAngles]
"""Joint angles and when the eyes had them [s]."""


@dataclass(frozen=True)
class EyeState:
    """What the eyes do at a frame.

    `saccading` tells whether they are in a saccade, `jumped` whether they were in one since the frame before; the
    joints have rested for `rested_s`, 0 while they turn.
    """

    saccading: bool
    jumped: bool
    rested_s: float


class EyeWatch:
    """Tells saccades and rest from the joint angles of successive frames, and from those that were told between them.

    Either eye's jump counts: one of the right eye alone is a jump in depth, to something else on the same ray.
    """

    def __init__(self, parameters: TrackerParameters) -> None:
        self._parameters = parameters
        self._history: deque[Told] = deque()
        self._frame: Told | None = None
        self._rest_since_s = math.nan

    def update(self, stamp_s: float, eyes: EyeAngles, on_the_way: Iterable[Told] = ()) -> EyeState:
        """Take the angles at a frame's stamp; stamps must increase. What of `on_the_way` is not since then is ignored.

        Without it, what happens between two frames that a busy machine lets be far apart is a guess.
        """
        jumped = False
        for told_s, angles in on_the_way:
            if self._history and self._history[-1][0] < told_s < stamp_s:
                jumped |= self._turns_fast(told_s, angles)
        saccading = self._turns_fast(stamp_s, eyes)
        if self._frame is None:
            self._rest_since_s = stamp_s
        else:
            before_s, before = self._frame
            if _turned_deg(before, eyes) > self._parameters.track_rest_deg_s * (stamp_s - before_s):
                self._rest_since_s = math.nan
            elif math.isnan(self._rest_since_s):
                self._rest_since_s = before_s
        self._frame = stamp_s, eyes
        rested = 0.0 if math.isnan(self._rest_since_s) else stamp_s - self._rest_since_s
        return EyeState(saccading, saccading or jumped, rested)

    def _turns_fast(self, stamp_s: float, eyes: EyeAngles) -> bool:
        p = self._parameters
        # The newest stays, however long ago it was. A little slack, so that frames 33 ms apart are still compared over
        # the whole of 67 ms.
        while len(self._history) > 1 and self._history[0][0] < stamp_s - p.track_saccade_s - 1e-3:
            self._history.popleft()
        # Of a late frame nobody knows how fast the eyes turned before it: twice the time is still one glance.
        fast = any(
            _turned_deg(before, eyes) > p.track_saccade_deg * max(0.5 * (stamp_s - s) / p.track_saccade_s, 1.0)
            for s, before in self._history
        )
        self._history.append((stamp_s, eyes))
        return fast


def _turned_deg(before: EyeAngles, now: EyeAngles) -> float:
    return math.degrees(
        max(
            abs(now.pan_left_rad - before.pan_left_rad),
            abs(now.pan_right_rad - before.pan_right_rad),
            abs(now.tilt_rad - before.tilt_rad),
        )
    )


@dataclass(frozen=True)
class EyeView:
    """One eye's camera at one moment; turns its pixels into directions in rig_base and back."""

    camera: CameraModel
    pan_rad: float
    tilt_rad: float

    def direction(self, pixel: Pixel) -> np.ndarray:
        """Return the unit direction (3,) in rig_base of a pixel."""
        ray = self.camera.pixel_to_ray(np.array([pixel]))[0]
        return np.asarray(rotation_rig_from_optical(self.pan_rad, self.tilt_rad) @ ray)

    def pixel(self, direction: np.ndarray) -> Pixel:
        """Return where a direction in rig_base is seen; NaN behind the eye."""
        ray = rotation_rig_from_optical(self.pan_rad, self.tilt_rad).T @ direction
        u, v = self.camera.ray_to_pixel(ray[None, :])[0]
        return float(u), float(v)
