import pytest

from vergence_metric.pairs.stream_health import StreamHealth


def thirty_hz(seconds: float = 2.0) -> StreamHealth:
    health = StreamHealth("left/image_raw", 100.0)
    for i in range(round(seconds * 30)):
        health.accept(100.0 + i / 30, 0.012, (640, 480))
    return health


def test_a_healthy_stream_reports_its_rate_age_and_size() -> None:
    status = thirty_hz().status(102.0, publishers=1, stalled_after_s=1.0)
    assert status.ok
    assert status.message == "left/image_raw: 30.0 Hz"
    assert status.values["rate_hz"] == pytest.approx(30.0)
    assert status.values["age_median_ms"] == pytest.approx(12.0)
    assert status.values["size_px"] == "640x480"


def test_silence_is_reported_with_its_length_and_whether_there_is_a_publisher() -> None:
    health = thirty_hz()
    last_s = 100.0 + 59 / 30
    assert health.status(last_s + 1.0, 1, 1.0).ok
    assert health.status(last_s + 1.2, 1, 1.0).message == "left/image_raw: no image for 1.2 s"
    assert (
        health.status(last_s + 1.2, 0, 1.0).message == "left/image_raw: no image for 1.2 s (the topic has no publisher)"
    )


def test_a_stream_that_never_began_is_waited_for_and_then_named() -> None:
    health = StreamHealth("right/image_raw", 100.0)
    assert health.status(100.5, 0, 1.0).ok
    status = health.status(103.0, 0, 1.0)
    assert not status.ok
    assert status.message == "right/image_raw: no image since the start, 3.0 s (the topic has no publisher)"


def test_a_refusal_is_reported_until_a_good_image_comes() -> None:
    health = thirty_hz()
    health.refuse(102.0, "encoding is 'x'")
    status = health.status(102.1, 1, 1.0)
    assert (status.ok, status.message) == (False, "left/image_raw: encoding is 'x'")
    health.accept(102.1, 0.01, (640, 480))
    status = health.status(102.2, 1, 1.0)
    assert status.ok
    assert status.values["refused"] == 1
    assert status.values["received"] == 62


def test_two_publishers_are_named() -> None:
    status = thirty_hz().status(102.0, 2, 1.0)
    assert (status.ok, status.message) == (False, "left/image_raw must have one publisher: got 2")


def test_the_rate_forgets_what_was_before_a_gap() -> None:
    health = thirty_hz()
    for i in range(10):
        health.accept(200.0 + i / 10, 0.01, (640, 480))
    assert health.rate_hz == pytest.approx(10.0)
