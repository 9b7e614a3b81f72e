"""Centre windows: the squares around the principal point in which the paper measures vergence."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray


class WindowError(ValueError):
    """A window or an image without extent."""


@dataclass(frozen=True)
class Window:
    """A centre window of one image, cut to the image: rows `top` to `bottom`, columns `left` to `right`, half open.

    `size_px` is the requested side; `clipped` is true if what the cameras saw is smaller than that in one direction.
    """

    size_px: int
    top: int
    left: int
    bottom: int
    right: int

    @property
    def height(self) -> int:
        """Rows inside the image."""
        return self.bottom - self.top

    @property
    def width(self) -> int:
        """Columns inside the image."""
        return self.right - self.left

    @property
    def clipped(self) -> bool:
        """True where what the cameras saw ends before the window does."""
        return self.height < self.size_px or self.width < self.size_px

    def lattice(self, points_per_side: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return rows and columns, from the window's corner, of at most that many pixels a side, evenly spread."""
        return _evenly(self.height, points_per_side), _evenly(self.width, points_per_side)

    def cut(self, other: "Window") -> "Window":
        """Return what of the window lies in another."""
        top, left = max(self.top, other.top), max(self.left, other.left)
        return replace(
            self, top=top, left=left, bottom=min(self.bottom, other.bottom), right=min(self.right, other.right)
        )

    def shifted(self, down: int, right: int) -> "Window":
        """Return the window as it lies in an image whose top left pixel is moved."""
        return replace(
            self,
            top=self.top - down,
            left=self.left - right,
            bottom=self.bottom - down,
            right=self.right - right,
        )

    @property
    def slices(self) -> tuple[slice, slice]:
        """Rows and columns, to index an image with."""
        return slice(self.top, self.bottom), slice(self.left, self.right)


def centre_window(size_px: int, height_px: int, width_px: int) -> Window:
    """Return the window of side `size_px` that starts at row h//2 - s//2, column w//2 - s//2, cut to the image.

    Raises WindowError where the window or the image has no extent.
    """
    if size_px < 1 or height_px < 1 or width_px < 1:
        raise WindowError(f"window and image must measure at least 1 px: got {size_px} px in {width_px}x{height_px}")
    top, left = height_px // 2 - size_px // 2, width_px // 2 - size_px // 2
    return Window(size_px, max(top, 0), max(left, 0), min(top + size_px, height_px), min(left + size_px, width_px))


def centre_windows(
    sizes_px: Iterable[int], height_px: int, width_px: int, seen_px: int | None = None
) -> tuple[Window, ...]:
    """Return one centre window per size, in the order given; raises WindowError as `centre_window` does.

    `seen_px` is the side of the largest centre square that the cameras saw; None for the whole image.
    """
    found = tuple(centre_window(size_px, height_px, width_px) for size_px in sizes_px)
    if seen_px is None:
        return found
    seen = centre_window(max(seen_px, 1), height_px, width_px)
    return tuple(window.cut(seen) for window in found)


def hull(windows: Iterable[Window]) -> Window:
    """Return the smallest window that holds all of them: of centre windows, the largest. Empty if there are none."""
    windows = tuple(windows)
    return Window(
        max((w.size_px for w in windows), default=0),
        min((w.top for w in windows), default=0),
        min((w.left for w in windows), default=0),
        max((w.bottom for w in windows), default=0),
        max((w.right for w in windows), default=0),
    )


def _evenly(length: int, most: int) -> NDArray[np.int64]:
    count = min(length, most)
    return ((2 * np.arange(count, dtype=np.int64) + 1) * length) // (2 * count)
