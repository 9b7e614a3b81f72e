"""Edges in an area of one eye's successive images. All of an image is blurred only where it gives new thresholds."""

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_metric.edges.edges import Edges, Gradient, Grey, Thresholds, blurred, canny, gradients, thresholds_of
from vergence_metric.edges.parameters import EdgeParameters
from vergence_metric.edges.scratch import Scratch

_OVERVIEW_WH, _OVERVIEW_EVERY = (20, 15), 4  # of every so many rows: the mean of 256 pixels of a webcam hides its noise
_CHANGED_LEVELS = 1.0  # mean difference of two overviews from which the thresholds may differ [grey levels]
_MOST_IMAGES = 15  # that thresholds serve for
_REACH_IN_SIGMAS = 4.0  # of the blur, beside the gradient's pixel


class EdgeDetector:
    """Detects edges by the thresholds of the whole image, which are kept while that does not change."""

    def __init__(self, parameters: EdgeParameters) -> None:
        self._parameters = parameters
        self._scratch = Scratch()
        self._seen: NDArray[np.uint8] | None = None  # the overview of the image that gave the thresholds
        self._thresholds: Thresholds = (math.nan, math.nan)
        self._images = 0  # for which they have served

    def detect_within(self, grey: Grey, area: tuple[slice, slice]) -> Edges:
        """Return the edges in an area (rows, columns) of the next (h, w) uint8 image; arrays are of the area's size.

        They are those of `detect_edges` there, except at the area's border, and for weak ones that join a strong one
        outside of the area only. The gradients are good until the next image.
        """
        overview = np.asarray(cv2.resize(grey[::_OVERVIEW_EVERY], _OVERVIEW_WH, interpolation=cv2.INTER_AREA), np.uint8)
        if self._is_known(overview):
            self._images += 1
            return self._within(grey, area)
        gradient_x, gradient_y = self._gradients(grey)
        self._seen, self._images = overview, 1
        self._thresholds = thresholds_of(gradient_x, gradient_y, self._parameters)
        return canny(gradient_x[area], gradient_y[area], self._thresholds)

    def _is_known(self, overview: NDArray[np.uint8]) -> bool:
        """Return whether an image of this overview has the thresholds of the one that gave them."""
        if self._seen is None or self._images >= _MOST_IMAGES:
            return False
        return cv2.norm(overview, self._seen, cv2.NORM_L1) <= _CHANGED_LEVELS * overview.size

    def _within(self, grey: Grey, area: tuple[slice, slice]) -> Edges:
        """Return the edges in an area by the thresholds that are known."""
        reach = math.ceil(_REACH_IN_SIGMAS * self._parameters.blur_sigma_px) + 2
        around = tuple(slice(max(way.start - reach, 0), way.stop + reach) for way in area)
        inside = tuple(slice(a.start - b.start, a.stop - b.start) for a, b in zip(area, around, strict=True))
        gradient_x, gradient_y = self._gradients(grey[around])
        return canny(gradient_x[inside], gradient_y[inside], self._thresholds)

    def _gradients(self, grey: Grey) -> tuple[Gradient, Gradient]:
        image = blurred(grey, self._parameters, self._scratch.array("blurred", grey.shape, np.uint8))
        buffers = (self._scratch.array(f"gradient {axis}", grey.shape, np.int16) for axis in "xy")
        return gradients(image, *buffers)
