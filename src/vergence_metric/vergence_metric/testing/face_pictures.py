"""Pictures of faces that scikit-image carries: the astronaut Eileen Collins, and Labeled Faces in the Wild at 25 px."""

import cv2
import numpy as np

from vergence_metric.testing.face_panels import FacePicture

_ASTRONAUT = (slice(20, 220), slice(130, 320))
_ASTRONAUT_BOX = (178.5, 63.0, 269.5, 173.5)
_ASTRONAUT_LANDMARKS = ((203.2, 101.0), (246.3, 103.2), (222.0, 127.0), (202.0, 140.0), (245.0, 140.0))
_SMALL_SCALE = 6
_SMALL_LANDMARKS = ((8.0, 8.5), (16.0, 8.5), (12.0, 13.0), (8.7, 17.5), (15.3, 17.5))
_SMALL_FACES = 100


def astronaut() -> FacePicture:
    """Return the astronaut's face; raises ImportError where scikit-image is not installed."""
    from skimage import data

    rows, columns = _ASTRONAUT
    image = np.ascontiguousarray(data.astronaut()[rows, columns, ::-1])
    shift = np.array([columns.start, rows.start])
    x_min, y_min, x_max, y_max = (np.array(_ASTRONAUT_BOX) - np.tile(shift, 2)).tolist()
    return FacePicture(image, (x_min, y_min, x_max, y_max), np.array(_ASTRONAUT_LANDMARKS) - shift)


def small_faces(count: int = _SMALL_FACES) -> list[FacePicture]:
    """Return up to 100 faces of 25x25 px, enlarged, each in a tint of its own; raises ImportError as `astronaut`."""
    from skimage import data

    rng = np.random.default_rng(5)
    pictures = []
    for grey in data.lfw_subset()[:_SMALL_FACES][:count]:
        large = cv2.resize(grey, None, fx=_SMALL_SCALE, fy=_SMALL_SCALE, interpolation=cv2.INTER_CUBIC)
        tint = np.array([0.75, 0.85, 1.0]) * rng.uniform(0.85, 1.1, 3)
        image = np.clip(255.0 * large[..., None] * tint, 0, 255).astype(np.uint8)
        landmarks = (np.array(_SMALL_LANDMARKS) + 0.5) * _SMALL_SCALE - 0.5
        side = float(image.shape[0])
        pictures.append(FacePicture(image, (0.12 * side, 0.08 * side, 0.88 * side, 0.95 * side), landmarks))
    return pictures
