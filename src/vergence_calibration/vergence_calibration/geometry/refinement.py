"""Sightings brought into line with one of their own: patches of one thing, turned as the eyes were, laid on each other.

Features are found anew in every image, each a fifth of a pixel off. What surrounds them is the same in all: the patch
about one sighting of a thing is warped as the views' poses tell, and shifted until it fits the image about another
(Baker and Matthews, Lucas-Kanade 20 Years On, 2004, inverse compositional, with gain and offset).
"""

from collections.abc import Sequence

import cv2
import numpy as np
import numpy.typing as npt

from vergence_calibration.eye_turn import Image
from vergence_calibration.geometry.views import Observations

Array = npt.NDArray[np.float64]

_HALF_PX = 8
_STEPS = 6
_CONVERGED_PX = 0.01
_FARTHEST_PX = 1.5  # from where the feature was found
_LEAST_SIMILARITY = 0.8  # a noisy camera blurs it
_LEAST_VIEWS = 3
_WORST_CONDITION = 100.0  # of the patch's slopes: beyond it is an edge
_SIDE_PX = 2 * _HALF_PX + 1


def refined(pictures: Sequence[Image], seen: Observations, by_direction: Array) -> Observations:
    """Return the sightings of things of which one patch fits at least `_LEAST_VIEWS` views, where it fits.

    Args:
        pictures: of each view, grey (h, w) uint8.
        seen: N sightings in pixels of the pictures.
        by_direction: (N, 2, 2) how a sighting moves by two small turns of its direction, the same two for one thing.
    """
    pixels, fits = seen.pixels.copy(), np.zeros(len(seen.view), np.bool_)
    with np.errstate(invalid="ignore"):
        usable = np.abs(np.linalg.det(by_direction)) > 0.0  # not NaN: behind the camera
    middles = np.array([(0.5 * (p.shape[1] - 1), 0.5 * (p.shape[0] - 1)) for p in pictures])
    off = np.linalg.norm(seen.pixels - middles[seen.view], axis=1)
    # Things in turn, of each the sighting nearest to the middle of its image first: there it is least distorted.
    order = np.lexsort((off, seen.point))
    order = order[usable[order]]
    for mine in np.split(order, np.flatnonzero(np.diff(seen.point[order])) + 1):
        first, *others = mine.tolist()
        fits[first] = True
        for other in others:
            back = by_direction[first] @ np.linalg.inv(by_direction[other])
            patch = _warped(pictures[seen.view[first]], seen.pixels[first], back)
            place = _fitted(pictures[seen.view[other]], seen.pixels[other], patch)
            if place is not None:
                pixels[other], fits[other] = place, True
    fits &= np.bincount(seen.point, fits)[seen.point] >= _LEAST_VIEWS
    return Observations(seen.view, seen.point, pixels).kept(fits)


def _warped(picture: Image, pixel: Array, back: Array) -> Array:
    """Return the patch about a pixel, of which steps from its middle are steps in the picture by a matrix (2, 2)."""
    middle = np.full(2, float(_HALF_PX))
    matrix = np.column_stack([back, pixel - back @ middle])
    return np.asarray(
        cv2.warpAffine(
            picture,
            matrix,
            (_SIDE_PX, _SIDE_PX),
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_REPLICATE,
        ),
        np.float64,
    )


def _fitted(picture: Image, pixel: Array, patch: Array) -> Array | None:
    """Return where a patch fits a picture best near a pixel, None where it does not fit."""
    height, width = picture.shape
    if not (_HALF_PX < pixel[0] < width - 1 - _HALF_PX and _HALF_PX < pixel[1] < height - 1 - _HALF_PX):
        return None
    down, across = np.gradient(patch)
    patch, across, down = ((part - part.mean()).ravel() for part in (patch, across, down))
    size = float(patch @ patch)
    slopes = np.column_stack([across, down])
    normal = slopes.T @ slopes
    if size <= 0.0 or np.linalg.cond(normal) > _WORST_CONDITION:
        return None
    shift = np.linalg.solve(normal, slopes.T)
    place = pixel.copy()
    for _ in range(_STEPS):
        seen = cv2.getRectSubPix(
            picture, (_SIDE_PX, _SIDE_PX), (float(place[0]), float(place[1])), patchType=cv2.CV_32F
        )
        flat = np.asarray(seen, np.float64).ravel()
        flat -= flat.mean()
        gain = float(patch @ flat) / size
        if gain <= 0.0:
            return None
        step = shift @ (flat / gain - patch)
        place = place - step
        if np.abs(place - pixel).max() > _FARTHEST_PX:
            return None
        if np.abs(step).max() < _CONVERGED_PX:
            break
    similarity = float(patch @ flat) / float(np.sqrt(size * (flat @ flat)))
    return place if similarity >= _LEAST_SIMILARITY else None
