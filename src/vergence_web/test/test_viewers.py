"""A page gets the newest when it has drawn the last; a slow one never has a queue."""

import asyncio
import json
import math
from collections.abc import Coroutine
from typing import Any

from vergence_web.eye_pair import EyeFrame, EyePair
from vergence_web.requests import Drawn
from vergence_web.update import HEADER, Board, Part, encode
from vergence_web.viewers import Viewer, Viewers


def decoded(data: bytes) -> tuple[dict[str, Any], dict[str, bytes]]:
    (length,) = HEADER.unpack_from(data)
    header = json.loads(data[4 : 4 + length])
    images, offset = {}, 4 + length
    for image in header["images"]:
        images[image["name"]] = data[offset : offset + image["bytes"]]
        offset += image["bytes"]
    assert offset == len(data)
    return header, images


def text(number: int) -> Part:
    return Part(json.dumps({"n": number}))


def test_an_update_is_a_header_and_the_images() -> None:
    parts = {"left": Part(data=b"LEFT", about={"stamp": "5"}), "state": text(3), "right": Part(data=b"R")}
    header, images = decoded(encode(9, parts))
    assert (header["number"], header["state"], header["images"][0]["stamp"]) == (9, {"n": 3}, "5")
    assert images == {"left": b"LEFT", "right": b"R"}


def test_a_board_gives_what_is_newer() -> None:
    board = Board()
    board.post({"a": text(1), "b": text(1)})
    version, parts = board.newer_than(0)
    assert set(parts) == {"a", "b"}
    board.post({"b": text(2)})
    assert board.newer_than(version)[1] == {"b": text(2)}
    board.clear()
    assert board.newer_than(0)[1] == {}


class Page:
    """A page that receives updates into a list."""

    def __init__(self, viewers: Viewers) -> None:
        self.received: list[dict[str, Any]] = []
        self.arrived = asyncio.Event()
        self.viewer: Viewer = viewers.open(self._send)
        self.task = asyncio.get_running_loop().create_task(self.viewer.run())

    async def _send(self, data: bytes) -> None:
        self.received.append(decoded(data)[0])
        self.arrived.set()

    async def next(self) -> dict[str, Any]:
        await asyncio.wait_for(self.arrived.wait(), 10.0)
        self.arrived.clear()
        return self.received[-1]


async def settled() -> None:
    """Let every task run until it waits."""
    for _ in range(10):
        await asyncio.sleep(0)


def run(test: Coroutine[Any, Any, None]) -> None:
    asyncio.run(test)


def test_a_slow_page_gets_the_newest_and_no_queue() -> None:
    async def test() -> None:
        viewers = Viewers(lambda count, edges: None)
        page = Page(viewers)
        for number in range(50):
            viewers.post({"state": text(number)})
            await settled()
        assert [update["state"]["n"] for update in page.received] == [0, 1]
        assert not viewers.ready
        page.viewer.on_drawn(Drawn(1, math.nan))
        await settled()
        assert [update["state"]["n"] for update in page.received] == [0, 1, 49]
        page.task.cancel()

    run(test())


def test_a_slow_page_does_not_slow_another() -> None:
    async def test() -> None:
        viewers = Viewers(lambda count, edges: None)
        slow, quick = Page(viewers), Page(viewers)
        for number in range(10):
            viewers.post({"state": text(number)})
            await settled()
            quick.viewer.on_drawn(Drawn(len(quick.received), 0.02))
        assert [update["state"]["n"] for update in quick.received] == list(range(10))
        assert len(slow.received) == 2
        assert viewers.latency_s() == 0.02
        for page in (slow, quick):
            page.task.cancel()

    run(test())


def test_what_was_never_sent_is_not_drawn() -> None:
    async def test() -> None:
        viewers = Viewers(lambda count, edges: None)
        page = Page(viewers)
        for number in range(3):
            viewers.post({"state": text(number)})
            await settled()
        page.viewer.on_drawn(Drawn(99, 0.1))
        await settled()
        assert len(page.received) == 2
        assert math.isnan(viewers.latency_s())
        page.task.cancel()

    run(test())


def test_the_edges_go_to_pages_that_show_them() -> None:
    async def test() -> None:
        counts: list[tuple[int, bool]] = []
        viewers = Viewers(lambda count, edges: counts.append((count, edges)))
        page, other = Page(viewers), Page(viewers)
        other.viewer.shows_edges = True
        viewers.changed()
        viewers.post({"edges": Part(data=b"E"), "state": text(1)})
        await settled()
        assert [image["name"] for image in other.received[0]["images"]] == ["edges"]
        assert page.received[0]["images"] == []
        viewers.close(other.viewer)
        viewers.close(page.viewer)
        assert counts == [(1, False), (2, False), (2, True), (1, False), (0, False)]
        for one in (page, other):
            one.task.cancel()

    run(test())


def test_a_new_page_is_not_shown_what_is_old() -> None:
    async def test() -> None:
        viewers = Viewers(lambda count, edges: None)
        page = Page(viewers)
        viewers.post({"state": text(1)})
        await page.next()
        viewers.close(page.viewer)
        page.task.cancel()
        later = Page(viewers)
        await settled()
        assert later.received == []
        later.task.cancel()

    run(test())


def frames(pair: EyePair, eye: str, stamp_ms: float, now_ms: float, rate_hz: float = 15.0) -> dict[str, int]:
    due = pair.add(eye, EyeFrame(None, round(stamp_ms * 1e6)), now_ms * 1e-3, rate_hz)
    return {name: frame.stamp_ns // 1_000_000 for name, frame in due.items()}


def test_images_of_one_moment_go_together() -> None:
    pair = EyePair()
    assert frames(pair, "left", 0, 10) == {}
    assert frames(pair, "right", 11, 21) == {"left": 0, "right": 11}


def test_images_above_the_rate_are_left_out() -> None:
    pair, sent = EyePair(), []
    for number in range(30):
        for eye in ("left", "right"):
            due = frames(pair, eye, 33.3 * number, 33.3 * number + 5, 15.0)
            sent += [due] if due else []
    assert len(sent) == 15
    assert all(due["left"] == due["right"] for due in sent)


def test_images_of_different_moments_wait_for_their_partner() -> None:
    pair = EyePair()
    frames(pair, "left", 0, 1)
    assert frames(pair, "right", 60, 61) == {}
    assert frames(pair, "left", 66, 67) == {"left": 66, "right": 60}


def test_a_lone_eye_is_shown_too() -> None:
    pair = EyePair()
    frames(pair, "left", 0, 1)
    assert set(pair.lone(1.0, 0.15)) == {"left"}
    frames(pair, "left", 1100, 1100)
    assert pair.lone(1.1, 0.15) == {}
    assert set(pair.lone(1.2, 0.15)) == {"left"}
