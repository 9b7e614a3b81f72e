import pytest

from vergence_metric.pairs.stage_times import StageTimes


def test_median_and_99th_percentile_of_the_latest_times_in_order_of_appearance() -> None:
    times = StageTimes()
    for _ in range(500):
        times.add("edges", 1.0)  # long past, forgotten
    for i in range(150):
        times.add_all({"edges": 0.002, "metric": 0.001 * i})
    summary = times.summary()
    assert list(summary) == ["edges_median_ms", "edges_p99_ms", "metric_median_ms", "metric_p99_ms"]
    assert summary["edges_p99_ms"] == pytest.approx(2.0)
    assert summary["metric_median_ms"] == pytest.approx(74.5)
    assert summary["metric_p99_ms"] == pytest.approx(147.51)


def test_a_block_that_fails_has_no_time() -> None:
    times = StageTimes()
    with times.measure("good"):
        pass
    with pytest.raises(ValueError, match="bad"), times.measure("bad"):
        raise ValueError("bad")
    assert list(times.summary()) == ["good_median_ms", "good_p99_ms"]
