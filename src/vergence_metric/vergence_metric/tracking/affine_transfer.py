"""Affine structure of a cluster of corners, and the camera of each eye in it: a fixed point is transferred by them.

After Reid and Murray, "Active tracking of foveated feature clusters using affine structure" (1996), with Tomasi and
Kanade's factorisation: what an affine camera sees of corners S (N, 3) is S A^T + t, and a point that is fixed in the
structure is where the camera of the corners that are seen puts it, whichever these are. Two eyes see all three
coordinates at once; the third gets sharper as the target turns. Cameras and structure are estimated in turn, each with
its covariance: a camera keeps from its last state what the corners that are seen do not determine. With four or more
corners that are not coplanar nothing is kept, with three or coplanar ones the third column, with fewer all but the
position, which is their mean motion. So there are no modes, and no step between them.
"""

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]

_SIGMA_PX = 0.5  # of a corner's position
_TURN = 0.015  # change of a camera's matrix from pair to pair, standard deviation of each element
_FREE_PX = 50.0  # that of its position: not predicted
_OUTLIER_PX = 1.5
_ROUNDS = 4


class AffineCamera:
    """One eye's affine camera: pixels (N, 2) = structure (N, 3) `matrix` (2, 3)^T + `origin_px` (2,).

    `origin_px` is where the camera sees the structure's origin, the fixed point.
    """

    def __init__(self, matrix: Points, origin_px: Points) -> None:
        self._state = np.column_stack([matrix, origin_px])
        self._covariance = np.diag([1e-6, 1e-6, 1e-6, _FREE_PX**2])

    @property
    def matrix(self) -> Points:
        """The matrix (2, 3)."""
        return self._state[:, :3]

    @property
    def origin_px(self) -> Points:
        """Where the structure's origin is seen (2,)."""
        return self._state[:, 3]

    @property
    def scale(self) -> float:
        """How much larger the structure is seen than when it was fixed."""
        return float(np.sqrt(abs(np.linalg.det(self._state[:, :2]))))

    @property
    def sigma_px(self) -> float:
        """Standard deviation of `origin_px`, each way, after `fit`."""
        return float(np.sqrt(self._covariance[3, 3]))

    def copy(self) -> "AffineCamera":
        """Return a camera of the same state, to go back to."""
        other = AffineCamera(self.matrix, self.origin_px)
        other._covariance = self._covariance
        return other

    def turn(self, jacobian: Points) -> None:
        """Say that the eye has turned: what was a step of (2,) px is now `jacobian` (2, 2) times it."""
        self._state[:, :3] = jacobian @ self._state[:, :3]

    def move(self, origin_px: Points) -> None:
        """Say where the origin is expected; the next `fit` starts there."""
        self._state[:, 3] = origin_px

    def project(self, structure: Points) -> Points:
        """Return where the structure (N, 3) is seen (N, 2)."""
        return np.asarray(structure @ self.matrix.T + self.origin_px)

    def fit(self, structure: Points, depth_variance: Points, pixels: Points) -> NDArray[np.bool_]:
        """Fit the camera to corners (N, 3) seen at pixels (N, 2); returns which of them agree with it (N,).

        `depth_variance` (N,) is that of the corners' third coordinates. Corners that disagree do not count: the
        weights are Geman and McClure's.
        """
        predicted = self._covariance + np.diag([_TURN**2, _TURN**2, _TURN**2, 0.0])
        predicted[3, :], predicted[:, 3] = 0.0, 0.0
        predicted[3, 3] = _FREE_PX**2
        prior, start = np.linalg.inv(predicted), self._state
        design = np.column_stack([structure, np.ones(len(structure))])
        tolerance = self._tolerance(depth_variance)
        variance = tolerance - _OUTLIER_PX**2 + _SIGMA_PX**2
        # The first weights are about the median motion, which half of the corners may not share.
        off = pixels - self.project(structure)
        off = ((off - np.median(off, axis=0)) ** 2).sum(axis=1)
        for _ in range(_ROUNDS):
            weights = (tolerance / (tolerance + off)) ** 2 / variance
            information = prior + (design * weights[:, None]).T @ design
            vector = prior @ start.T + (design * weights[:, None]).T @ pixels
            self._covariance = np.linalg.inv(information)
            self._state = (self._covariance @ vector).T
            off = ((pixels - self.project(structure)) ** 2).sum(axis=1)
        return np.asarray(off <= tolerance)

    def agrees(self, structure: Points, depth_variance: Points, pixels: Points) -> NDArray[np.bool_]:
        """Return which corners (N,) are where the camera sees them; see `fit`."""
        off = ((pixels - self.project(structure)) ** 2).sum(axis=1)
        return np.asarray(off <= self._tolerance(depth_variance))

    def _tolerance(self, depth_variance: Points) -> Points:
        return np.asarray(_OUTLIER_PX**2 + depth_variance * float((self.matrix[:, 2] ** 2).sum()))


class AffineStructure:
    """The coordinates (N, 3) of corners, each an information filter of what both cameras have seen of it.

    The first two coordinates are pixels of the left image in which the structure was fixed, the third a depth in the
    same unit. `depth_sigma` is how far corners lie before or behind the fixed point, before they are measured.
    """

    def __init__(self, depth_sigma: float) -> None:
        self._prior = np.diag([1e-9, 1e-9, 1.0 / depth_sigma**2])
        self._information, self._vector = np.empty((0, 3, 3)), np.empty((0, 3))
        self.points = np.empty((0, 3))
        self.depth_variance = np.empty(0)

    def append(self, count: int) -> NDArray[np.intp]:
        """Add corners of which nothing is known; returns their indices."""
        self._information = np.concatenate([self._information, np.tile(self._prior, (count, 1, 1))])
        self._vector = np.concatenate([self._vector, np.zeros((count, 3))])
        self.points = np.concatenate([self.points, np.zeros((count, 3))])
        self.depth_variance = np.concatenate([self.depth_variance, np.full(count, 1.0 / self._prior[2, 2])])
        return np.arange(len(self.points) - count, len(self.points))

    def observe(self, which: NDArray[np.intp], camera: AffineCamera, pixels: Points) -> None:
        """Add what a camera sees of corners `which` (M,), at pixels (M, 2)."""
        weight = 1.0 / _SIGMA_PX**2
        self._information[which] += weight * (camera.matrix.T @ camera.matrix)
        self._vector[which] += weight * (pixels - camera.origin_px) @ camera.matrix
        covariance = np.linalg.inv(self._information[which])
        self.points[which] = np.einsum("nij,nj->ni", covariance, self._vector[which])
        self.depth_variance[which] = covariance[:, 2, 2]

    def keep(self, kept: NDArray[np.bool_]) -> None:
        """Drop the corners that are not `kept` (N,)."""
        self._information, self._vector = self._information[kept], self._vector[kept]
        self.points, self.depth_variance = self.points[kept], self.depth_variance[kept]
