"""A textured wall as two turning eyes see it, with sensor noise: a scene that costs two milliseconds a pair."""

import math

import cv2
import numpy as np
import numpy.typing as npt

Pixels = npt.NDArray[np.uint8]

WIDTH_PX, HEIGHT_PX, FOCAL_PX = 320, 240, 270.0
_CELL_PX = 7
_SPEED_RAD_S = math.radians(4.0)
_SPAN = 4  # of the texture, in widths of a view
_NOISE, _NOISES = 2.0, 5


class TexturedWall:
    """Grey views (240, 320) of a wall that both eyes fixate with the vergence `needed_rad`."""

    def __init__(self, seed: int = 0, needed_rad: float = math.radians(4.0)) -> None:
        self.needed_rad = self.goal_rad = needed_rad
        self._random = np.random.default_rng(seed)
        size = (_SPAN * WIDTH_PX, _SPAN * HEIGHT_PX)
        cells = self._random.integers(0, 256, (size[1] // _CELL_PX, size[0] // _CELL_PX), dtype=np.uint8)
        coarse = cv2.GaussianBlur(cv2.resize(cells, size, interpolation=cv2.INTER_NEAREST), (0, 0), 1.2)
        self._texture = np.clip(0.75 * coarse.astype(np.float32) + 30, 0, 255).astype(np.float32)
        shape = (2 * HEIGHT_PX, 2 * WIDTH_PX)
        self._noise = [self._random.normal(0, _NOISE, shape).astype(np.float32) for _ in range(_NOISES)]

    def step(self, duration_s: float) -> None:
        """Let the wall go on its way to where it needs the vergence `goal_rad`, at no more than 4 degrees a second."""
        step_rad = _SPEED_RAD_S * duration_s
        self.needed_rad += min(max(self.goal_rad - self.needed_rad, -step_rad), step_rad)

    def view(self, left: bool, pan_rad: float, tilt_rad: float) -> Pixels:
        """Return what an eye sees at its pan (left positive) and tilt (down positive)."""
        # The left eye sees the wall's points further to the right by half of the vergence that they need.
        right_rad = -pan_rad - (0.5 if left else -0.5) * self.needed_rad
        x = 0.5 * (self._texture.shape[1] - WIDTH_PX) + FOCAL_PX * right_rad
        y = 0.5 * (self._texture.shape[0] - HEIGHT_PX) + FOCAL_PX * tilt_rad
        move = np.array([[1, 0, x], [0, 1, y]], np.float32)
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        seen = cv2.warpAffine(self._texture, move, (WIDTH_PX, HEIGHT_PX), flags=flags, borderMode=cv2.BORDER_REFLECT)
        row, column = self._random.integers(0, HEIGHT_PX), self._random.integers(0, WIDTH_PX)
        noise = self._noise[self._random.integers(_NOISES)][row : row + HEIGHT_PX, column : column + WIDTH_PX]
        return np.asarray(np.clip(np.rint(seen + noise), 0, 255), np.uint8)
