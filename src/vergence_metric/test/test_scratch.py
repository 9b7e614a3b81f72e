import cv2
import numpy as np

from vergence_metric.alignment.parameters import AlignmentParameters
from vergence_metric.edges.scratch import Scratch
from vergence_metric.measurement.edge_metric import EdgeMetric


def test_a_name_keeps_its_memory_and_grows_when_it_must() -> None:
    scratch = Scratch()
    first = scratch.array("a", (4, 5), np.int32)
    assert first.shape == (4, 5)
    assert first.dtype == np.int32
    assert np.shares_memory(first, scratch.array("a", (10,), np.uint8))
    assert not np.shares_memory(first, scratch.array("b", (4, 5), np.int32))
    assert scratch.array("a", (100, 100), np.float64).shape == (100, 100)


def test_kept_memory_does_not_leak_one_pair_into_the_next() -> None:
    rng = np.random.default_rng(0)
    images = [
        cv2.GaussianBlur(rng.integers(0, 255, size, dtype=np.uint8), (0, 0), 2.0)
        for size in ((480, 640), (240, 320), (480, 640), (120, 700))
    ]
    unaligned = AlignmentParameters(mode="none")
    kept = EdgeMetric(alignment=unaligned)
    for image in images:
        left, right = image, np.ascontiguousarray(image[:, ::-1])
        found, alone = (
            kept.measure(left, right),
            EdgeMetric(alignment=unaligned).measure(left, right),
        )
        for name in ("left_to_right_px", "right_to_left_px", "chance_left_to_right_px", "contrast"):
            np.testing.assert_array_equal(getattr(found, name), getattr(alone, name))
        np.testing.assert_array_equal(found.robust_right_to_left_px, alone.robust_right_to_left_px)
