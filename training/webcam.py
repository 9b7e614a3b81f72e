"""Image quality of a cheap camera."""

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]


def webcam(rng: np.random.Generator, image: Image) -> Image:
    """Return a render with a cheap camera's exposure, white balance, blur, noise and JPEG blocks."""
    gains = rng.uniform(0.75, 1.25) * rng.uniform(0.92, 1.08, 3)
    picture = np.clip(image * gains.astype(np.float32), 0, 255)
    if rng.random() < 0.3:
        picture = cv2.GaussianBlur(picture, (0, 0), rng.uniform(0.4, 1.3))
    noise = rng.standard_normal(picture.shape, dtype=np.float32) * np.float32(rng.uniform(0.0, 6.0))
    picture = np.clip(picture + noise, 0, 255).astype(np.uint8)
    if rng.random() < 0.7:
        _, jpeg = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(65, 96))])
        picture = np.asarray(cv2.imdecode(jpeg, cv2.IMREAD_COLOR), np.uint8)
    return np.asarray(picture, np.uint8)
