"""A body before a wall far away, drawn with numpy: what both eyes see moves as they turn."""

import math

import cv2
import numpy as np

from vergence.body import Array, JointAngles, Picture, Pixels
from vergence_metric.pairs.pairing import LEFT, RIGHT
from vergence_rig.camera import CameraModel
from vergence_rig.rig import Rig, default_rig
from vergence_rig.servo import IDEAL

_FRAME_S, _MARGIN_PX = 1.0 / 30.0, 200


class WallBody:
    """Ideal joints that jump to where they are commanded; both cameras expose at once.

    Args:
        distance_px: disparity of the wall while both eyes look straight ahead.
    """

    can_move = True

    def __init__(self, distance_px: int = 12) -> None:
        self.rig: Rig = default_rig().with_servos(IDEAL)
        self.cameras = CameraModel(self.rig.left_camera), CameraModel(self.rig.right_camera)
        self.time_s, self.closed = 0.0, False
        self.joints_rad = np.zeros(3)
        self._distance_px, self._frames = distance_px, 0
        camera = self.rig.left_camera
        self._size_px, self._focal_px = (camera.width_px, camera.height_px), camera.fx_px
        self._random = random = np.random.default_rng(3)
        shape = (camera.height_px + 2 * _MARGIN_PX, camera.width_px + 2 * _MARGIN_PX, 3)
        wall = cv2.GaussianBlur(random.integers(0, 256, shape, np.uint8), (0, 0), 3.0)
        noise = random.normal(0.0, 2.0, (camera.height_px + 16, camera.width_px + 16, 3))
        self._noise = np.rint(noise).astype(np.int16)
        self._wall = np.asarray(cv2.normalize(wall, None, 0, 255, cv2.NORM_MINMAX), np.uint8)

    def advance(self, duration_s: float) -> list[Picture | JointAngles]:
        """See Body."""
        self.time_s += duration_s
        stamp_ns = round(self.time_s * 1e9)
        arrived: list[Picture | JointAngles] = [JointAngles(stamp_ns, self.joints_rad.copy())]
        if self.time_s >= self._frames * _FRAME_S:
            self._frames += 1
            arrived += [Picture(side, stamp_ns, self.view(side)) for side in (LEFT, RIGHT)]
        return arrived

    def view(self, side: int) -> Pixels:
        """Return what an eye sees now."""
        pan, tilt = self.joints_rad[side], self.joints_rad[2]
        x = _MARGIN_PX - round(self._focal_px * math.tan(pan)) + (self._distance_px if side == RIGHT else 0)
        y = _MARGIN_PX + round(self._focal_px * math.tan(tilt))
        width, height = self._size_px
        seen = self._wall[y : y + height, x : x + width]
        # A camera without noise would count as frozen.
        row, column = self._random.integers(0, 16, 2)
        return np.asarray(cv2.add(seen, self._noise[row : row + height, column : column + width], dtype=cv2.CV_8U))

    def command(self, joints_rad: Array) -> None:
        """See Body."""
        self.joints_rad = np.asarray(joints_rad, np.float64).copy()

    def close(self) -> None:
        """See Body."""
        self.closed = True
