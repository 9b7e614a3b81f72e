"""What a node says about inputs that do not come."""

from vergence_common.awaited import NOTICE_AFTER_S, waiting_text

SOURCES = "Images come from camera_node"


def test_the_line_comes_within_two_seconds():
    assert NOTICE_AFTER_S < 2.0


def test_without_a_publisher_it_says_who_would_publish_and_what_may_differ():
    text = waiting_text({"/left/image_raw": 0, "/right/image_raw": 0}, SOURCES)
    assert text.startswith(
        "waiting for /left/image_raw and /right/image_raw: nothing publishes there. Images come from"
    )
    assert "ROS_DOMAIN_ID" in text
    assert "-r /left/image_raw:=/its/topic" in text


def test_with_a_publisher_that_sends_nothing_it_says_where_to_look():
    text = waiting_text({"/left/image_raw": 1, "/right/image_raw": 0}, SOURCES)
    assert "/left/image_raw 1, /right/image_raw 0" in text
    assert "/diagnostics" in text
