"""The corners of one target: what each looks like, where it was last seen, and how far it can be relied on."""

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from vergence_metric.tracking.affine_transfer import AffineStructure
from vergence_metric.tracking.corners import Patches
from vergence_metric.tracking.direction_filter import DirectionFilter
from vergence_metric.tracking.eye_view import Points

Counts = NDArray[np.int_]

_MISSES = 3  # pairs without it after which a corner that was never established is dropped
_DISAGREEMENTS = 3  # pairs in a row in which it moves otherwise than the structure
_ESTABLISHED = 5  # pairs in which a corner that is added later must agree before it counts
_LATE = 10  # pairs without it after which a corner is no longer expected: it has turned away, or is covered
_MOST = 120


@dataclass
class _Records:
    """One row for each corner (N, ...)."""

    ids: Counts
    px: Points
    patches: Patches
    misses: Counts
    disagreements: Counts
    agreed: Counts


class KnownCorners:
    """Arrays with one row for each corner; `filters` and `structure` have the same rows.

    Args:
        sigma_rad: standard deviation of a corner's direction.
        depth_sigma: of the corners' depths, as `AffineStructure`.
    """

    def __init__(self, sigma_rad: float, depth_sigma: float) -> None:
        self.filters = DirectionFilter(np.empty((0, 2)), sigma_rad)
        self.structure = AffineStructure(depth_sigma)
        none = np.empty(0, int)
        self._records = _Records(none, np.empty((0, 2)), np.empty((0, 81), np.float32), none, none, none)
        self._next_id = 0

    def __len__(self) -> int:
        return len(self._records.ids)

    @property
    def ids(self) -> Counts:
        """A number for each corner (N,), never used again."""
        return self._records.ids

    @property
    def px(self) -> Points:
        """Where each was last seen in the left image (N, 2)."""
        return self._records.px

    @property
    def patches(self) -> Patches:
        """What each looked like then (N, 81); see `corners.patches_at`."""
        return self._records.patches

    @property
    def misses(self) -> Counts:
        """Pairs in a row in which each was not seen (N,)."""
        return self._records.misses

    @property
    def established(self) -> NDArray[np.bool_]:
        """Which have agreed with the structure for long enough to count (N,)."""
        return self._records.agreed >= _ESTABLISHED

    @property
    def expected(self) -> NDArray[np.bool_]:
        """Which of those that count were seen of late, and so are expected when the target is seen again (N,)."""
        return self.established & (self._records.misses < _LATE)

    @property
    def visible(self) -> NDArray[np.bool_]:
        """Which were seen in the last pair and agreed with the structure (N,)."""
        return (self._records.misses == 0) & (self._records.disagreements == 0)

    def update(self, which: Counts, px: Points, patches: Patches, agree: NDArray[np.bool_]) -> None:
        """Note that corners `which` (M,) were seen at `px` (M, 2), and which `agree` (M,) with the structure."""
        r = self._records
        r.misses += 1
        r.misses[which] = 0
        r.px[which] = px
        r.patches[which[agree]] = patches[agree]
        r.disagreements[which] = np.where(agree, 0, r.disagreements[which] + 1)
        r.agreed[which] += agree

    def append(self, px: Points, patches: Patches, angles: Points, rates: Points, established: bool) -> Counts:
        """Add corners (M, 2) with rates (2,) [rad/s]; returns their indices."""
        count = len(px)
        zeros = np.zeros(count, int)
        new = _Records(self._next_id + np.arange(count), px, patches, zeros, zeros, zeros + established * _ESTABLISHED)
        self._next_id += count
        self._records = _Records(
            *(
                np.concatenate([getattr(self._records, field.name), getattr(new, field.name)])
                for field in fields(_Records)
            )
        )
        self.filters.append(angles, rates)
        return self.structure.append(count)

    def forget(self) -> None:
        """Drop corners that belong to something else, new ones that are not seen again, and the longest unseen."""
        r = self._records
        kept = (r.disagreements < _DISAGREEMENTS) & ((r.misses < _MISSES) | self.established)
        if kept.sum() > _MOST:
            order = np.argsort(np.where(kept, r.misses, np.iinfo(int).max), kind="stable")
            kept[order[_MOST:]] = False
        if kept.all():
            return
        self._records = _Records(*(getattr(r, field.name)[kept] for field in fields(_Records)))
        self.filters.keep(kept)
        self.structure.keep(kept)
