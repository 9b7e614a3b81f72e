"""Dense optical flow after Horn and Schunck, "Determining optical flow" (1981), on a pyramid of displacements.

As Ding, Yan and We (2021, doi 10.3390/ijgi10040234) use it: half the size from level to level, the second image warped
by the flow so far, the brightness constancy linearised there, and Horn and Schunck's smoothness over the whole flow.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

Flow = NDArray[np.float32]
Image = NDArray[np.uint8]

ALPHA = 15.0
"""Weight of smoothness, in grey levels."""
ITERATIONS = (20, 60, 100, 100)
"""At each level, the finest first: coarser ones cost a quarter and start the finer ones near their solution."""
_NEIGHBOURS = np.array([[1, 2, 1], [2, 0, 2], [1, 2, 1]], np.float32) / 12.0
_GRADIENT = np.array([[-1.0, 8.0, 0.0, -8.0, 1.0]], np.float32) / -12.0
_SMOOTHING_PX = 0.8


def horn_schunck(before: Image, after: Image, alpha: float = ALPHA, iterations: tuple[int, ...] = ITERATIONS) -> Flow:
    """Return where each pixel of one grey image (h, w) went in the other, as (h, w, 2) of x and y [px]."""
    levels = [(_smooth(before), _smooth(after))]
    for _ in iterations[1:]:
        levels.append((cv2.pyrDown(levels[-1][0]), cv2.pyrDown(levels[-1][1])))
    flow = np.zeros((*levels[-1][0].shape, 2), np.float32)
    for (first, second), count in zip(reversed(levels), reversed(iterations), strict=True):
        height, width = first.shape
        if flow.shape[:2] != first.shape:
            scale = np.array([width / flow.shape[1], height / flow.shape[0]], np.float32)
            flow = cv2.resize(flow, (width, height), interpolation=cv2.INTER_LINEAR) * scale
        flow = _refined(first, second, flow, alpha, count)
    return flow


def warped(image: NDArray, flow: Flow) -> NDArray:
    """Return an image (h, w) as it would be if what is `flow` away were here."""
    y, x = np.mgrid[0 : flow.shape[0], 0 : flow.shape[1]].astype(np.float32)
    return np.asarray(
        cv2.remap(image, x + flow[..., 0], y + flow[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    )


def _smooth(image: Image) -> NDArray[np.float32]:
    return np.asarray(cv2.GaussianBlur(image.astype(np.float32), (0, 0), _SMOOTHING_PX))


def _refined(
    first: NDArray[np.float32], second: NDArray[np.float32], flow: Flow, alpha: float, iterations: int
) -> Flow:
    """Return the flow of one level after Jacobi's iterations about a start (h, w, 2)."""
    moved = warped(second, flow)
    mean = 0.5 * (first + moved)
    across, down = cv2.filter2D(mean, cv2.CV_32F, _GRADIENT), cv2.filter2D(mean, cv2.CV_32F, _GRADIENT.T)
    scale = 1.0 / (alpha**2 + across**2 + down**2)
    # What brightness constancy demands of the flow itself, not of its change.
    constant = moved - first - across * flow[..., 0] - down * flow[..., 1]
    gain = np.stack([across * scale, down * scale], axis=2)
    slopes = np.stack([across, down], axis=2)
    current = flow
    for _ in range(iterations):
        around = cv2.filter2D(current, cv2.CV_32F, _NEIGHBOURS, borderType=cv2.BORDER_REPLICATE)
        product = slopes * around
        residual = product[..., 0] + product[..., 1] + constant
        current = around - gain * residual[:, :, None]
    return np.asarray(current, np.float32)
