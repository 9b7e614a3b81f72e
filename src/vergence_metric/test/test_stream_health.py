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


def stamped(stamps_s: list[float], age_s: float = 0.01) -> StreamHealth:
    """A stream whose images arrive at 30 Hz and have these stamps."""
    health = StreamHealth("left/image_raw", 100.0)
    for i, stamp_s in enumerate(stamps_s):
        health.accept(100.0 + i / 30, age_s, (640, 480), stamp_s)
    return health


@pytest.mark.parametrize(
    ("stamps_s", "words"),
    [
        ([0.0] * 20, "stamps must increase from image to image: they are zero"),
        ([7.0] * 20, "stamps must increase from image to image: 19 of the last 19 do not"),
        ([9.0 - i / 30 for i in range(20)], "stamps must increase"),
        ([5.0 + i / 1.5 for i in range(5)], "slower than needed: 1.5 Hz, at least 5 Hz"),
        ([*(5.0 + i / 30 for i in range(60)), 7.6, 8.3, 9.0], "slower than needed: 1.4 Hz"),
    ],
)
def test_stamps_that_cannot_be_used_are_named(stamps_s: list[float], words: str) -> None:
    status = stamped(stamps_s).status(100.0 + len(stamps_s) / 30, 1, 1.0)
    assert not status.ok
    assert words in status.message


@pytest.mark.parametrize(
    ("age_s", "words"), [(10.0, "10 s old"), (-10.0, "10 s ahead of the clock"), (1.7e9, "1.7e+09 s old")]
)
def test_stamps_of_another_clock_are_named(age_s: float, words: str) -> None:
    status = stamped([5.0 + i / 30 for i in range(20)], age_s).status(100.7, 1, 1.0)
    assert not status.ok
    assert words in status.message


@pytest.mark.parametrize("rate_hz", [5.5, 15.0, 120.0])
def test_usual_rates_with_a_lost_frame_are_no_fault(rate_hz: float) -> None:
    stamps_s = [5.0 + i / rate_hz for i in range(40) if i % 11]
    assert stamped(stamps_s).status(100.0 + 36 / 30, 1, 1.0).ok
