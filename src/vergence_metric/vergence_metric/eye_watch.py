"""What the turning of the left eye does to tracking: when it is a saccade, when the eye rests, where pixels go."""

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from vergence_metric.fovea_parameters import TrackerParameters
from vergence_rig.camera import CameraModel
from vergence_rig.geometry import EyeAngles, rotation_rig_from_optical

Pixel = tuple[float, float]


@dataclass(frozen=True)
class EyeState:
    """Whether the left eye is in a saccade, and for how long its joints have rested (0 while they turn)."""

    saccading: bool
    rested_s: float


class EyeWatch:
    """Tells saccades and rest from the joint angles of successive frames (of the left eye: its pan and the tilt)."""

    def __init__(self, parameters: TrackerParameters) -> None:
        self._parameters = parameters
        self._history: deque[tuple[float, float, float]] = deque()
        self._rest_since_s = math.nan

    def update(self, stamp_s: float, eyes: EyeAngles) -> EyeState:
        """Take the angles at a frame's stamp; stamps must increase."""
        p = self._parameters
        now = (stamp_s, eyes.pan_left_rad, eyes.tilt_rad)
        saccading = any(
            math.degrees(max(abs(now[1] - pan), abs(now[2] - tilt))) > p.track_saccade_deg
            for _, pan, tilt in self._history
        )
        if self._history:
            before = self._history[-1]
            turned = math.degrees(max(abs(now[1] - before[1]), abs(now[2] - before[2])))
            if turned > p.track_rest_deg_s * (stamp_s - before[0]):
                self._rest_since_s = math.nan
            elif math.isnan(self._rest_since_s):
                self._rest_since_s = before[0]
        else:
            self._rest_since_s = stamp_s
        self._history.append(now)
        # A little slack, so that frames 33 ms apart are still compared over the whole of 100 ms.
        while self._history and self._history[0][0] < stamp_s - p.track_saccade_s - 1e-3:
            self._history.popleft()
        rested = 0.0 if math.isnan(self._rest_since_s) else stamp_s - self._rest_since_s
        return EyeState(saccading, rested)


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
