"""How often a target without bounds is segmented."""

import numpy as np

from vergence_metric.tracking.target_appearance import TargetAppearance
from vergence_metric.tracking.tracked_target import Target


def test_a_target_without_bounds_is_segmented_ever_more_rarely() -> None:
    image = np.zeros((60, 60), np.uint8)
    target = Target(
        track_id=1,
        lock_stamp_s=0.0,
        appearance=TargetAppearance(image, (30.0, 30.0), (20.0, 20.0)),
        seen_s=0.0,
        direction=np.array([1.0, 0.0, 0.0]),
        velocity=np.zeros(3),
        bounded=False,
    )
    due = [pair for pair in range(1, 130) if target.segmentation_due()]
    assert due == [1, 2, 4, 8, 16, 32, 64, 96, 128]
