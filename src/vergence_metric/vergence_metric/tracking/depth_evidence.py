"""What one pair says of a target's distance: the parallaxes that it may have, and the probability of each.

Where a texture repeats, windows of correlation cannot tell its repetitions apart. There each is looked at: the edges
about the point, in all directions, agree best where it really is.
"""

import numpy as np

from vergence_metric.disparity.protocol import Disparity, DisparityStatus
from vergence_metric.edges.verged_contrast import contrasts_if_verged
from vergence_metric.tracking.eye_view import Pixel
from vergence_metric.tracking.request import StoredPair
from vergence_metric.tracking.tracked_target import parallax

_SAME_PX = 2.0  # candidates this close to the answer are it
CONTRAST_POWER, LEAST_CONTRAST = -3.0, 0.05
"""Of the probability of a repetition; `bench/photos_repetitions.py` shows how they are chosen."""


def parallax_shares(disparity: Disparity, left_px: Pixel, pair: StoredPair) -> list[tuple[float, float]]:
    """Return the parallaxes [rad] that a pair gives a left pixel, the answer's first, and the probability of each.

    The answer has its confidence as probability, the estimator's other candidates share the rest by their likelihood.
    Repetitions are as likely as what they repeat, but for their contrast.
    """
    if disparity.status not in (DisparityStatus.OK, DisparityStatus.AMBIGUOUS):
        return []
    others = [c for c in disparity.candidates if abs(c.disparity_px - disparity.horizontal_px) > _SAME_PX]
    sure, rest = disparity.confidence, sum(c.likelihood for c in others)
    repeated = disparity.status is DisparityStatus.AMBIGUOUS and rest > 0.0
    if repeated:
        sure = min(sure, max(c.likelihood for c in disparity.candidates))
    left_over = (1.0 - sure) / max(rest, 1.0 - sure, 1e-6)
    seen = [(disparity.horizontal_px, sure), *((c.disparity_px, left_over * c.likelihood) for c in others)]
    y = left_px[1] - disparity.vertical_px
    at = [(left_px[0] - d, y) for d, _ in seen]
    shares = np.array([share for _, share in seen])
    if repeated:
        contrast = contrasts_if_verged(pair.left, pair.right, left_px, at)
        weighed = shares * np.power(np.nan_to_num(contrast, nan=1.0) + LEAST_CONTRAST, CONTRAST_POWER)
        shares = weighed * shares.sum() / weighed.sum()
    return [
        (parallax(left_px, pair.views, right_px), share) for right_px, share in zip(at, shares.tolist(), strict=True)
    ]
