"""Every message of a page is a valid request or refused in words."""

import json
import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vergence_web.requests import (
    COMMANDS,
    LONGEST_MESSAGE,
    Answer,
    Command,
    DetectedClass,
    Drawn,
    ListNodes,
    Message,
    Pixel,
    ReadParameters,
    RequestError,
    SetParameter,
    Show,
    parse,
)

STAMP = "1795825253548606464"


def sent(**values: Any) -> str:
    return json.dumps({"id": 7, **values})


@pytest.mark.parametrize(
    ("values", "request_"),
    [
        (
            {"do": "pixel", "eye": "left", "x": 12, "y": 3.5, "stamp": STAMP},
            Pixel(True, 12.0, 3.5, 1795825253548606464),
        ),
        (
            {"do": "pixel", "eye": "right", "x": 1, "y": 2, "stamp": "0", "width": 30, "height": 20.5},
            Pixel(False, 1.0, 2.0, 0, 30.0, 20.5),
        ),
        ({"do": "class", "name": "cube"}, DetectedClass("cube")),
        ({"do": "nodes"}, ListNodes()),
        ({"do": "parameters", "node": "/web_node"}, ReadParameters("/web_node")),
        ({"do": "set", "node": "/n", "name": "a.b", "value": 1.5}, SetParameter("/n", "a.b", 1.5)),
        ({"do": "set", "node": "/n", "name": "a", "value": [1, 2]}, SetParameter("/n", "a", (1, 2))),
        ({"do": "set", "node": "/n", "name": "a", "value": False}, SetParameter("/n", "a", False)),
        ({"do": "show", "edges": True}, Show(True)),
        ({"do": "drawn", "update": 4, "latency_s": 0.05}, Drawn(4, 0.05)),
        *(({"do": name}, Command(name)) for name in COMMANDS),
    ],
)
def test_a_request_is_read(values: dict[str, Any], request_: Any) -> None:
    assert parse(sent(**values)) == Message(7, request_)


def test_an_update_without_images_has_no_latency() -> None:
    request = parse(sent(do="drawn", update=1)).request
    assert isinstance(request, Drawn)
    assert math.isnan(request.latency_s)


PIXEL = {"do": "pixel", "eye": "left", "x": 1, "y": 2, "stamp": "3"}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "must be JSON"),
        ("[1]", "must be a JSON object"),
        ('{"do": "pixel", "x": NaN}', "must be JSON"),
        ("[" * 5000, "must be JSON"),
        (" " * (LONGEST_MESSAGE + 1), "at most"),
        (json.dumps({"do": "stop"}), "id must be given"),
        (json.dumps({"do": "stop", "id": True}), "id must be a whole number"),
        (sent(do="fly"), "do must be one of"),
        (sent(do=["stop"]), "do must be a text"),
        (sent(do="stop", now=True), "no other values: got ['now']"),
        (sent(**{**PIXEL, "eye": "middle"}), "eye must be left or right: got 'middle'"),
        (sent(**{**PIXEL, "x": "1"}), "x must be a number"),
        (sent(**{**PIXEL, "x": True}), "x must be a number"),
        (sent(**PIXEL)[:-1] + ', "x": 1e999}', "x must be a number"),
        (sent(**{**PIXEL, "stamp": 3}), "stamp must be nanoseconds"),
        (sent(**{**PIXEL, "stamp": "-3"}), "stamp must be nanoseconds"),
        (sent(**{**PIXEL, "stamp": "9" * 20}), "stamp must be nanoseconds"),
        (sent(**PIXEL, width=5), "height must be given"),
        (sent(**PIXEL, width=0, height=5), "width must be a number from 1"),
        (sent(do="class", name=""), "name must be a text of 1 to 256"),
        (sent(do="class", name="x" * 257), "name must be a text"),
        (sent(do="set", node="/n", name="a", value=None), "value must be true, false"),
        (sent(do="set", node="/n", name="a", value={"b": 1}), "value must be true, false"),
        (sent(do="set", node="/n", name="a", value=2**63), "value must be true, false"),
        (sent(do="set", node="/n", name="a", value=[1, "b"]), "of one kind"),
        (sent(do="set", node="/n", name="a", value=[[1]]), "value must be true, false"),
        (sent(do="show", edges=1), "edges must be true or false"),
    ],
)
def test_anything_else_is_refused_in_words(text: str, words: str) -> None:
    with pytest.raises(RequestError) as refused:
        parse(text)
    assert words in str(refused.value)
    assert len(str(refused.value)) < 1000


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
    max_leaves=12,
)


@given(JSON | st.dictionaries(st.sampled_from(["do", "id", "x", "y", "eye", "stamp", "value", "name", "node"]), JSON))
def test_no_message_raises_anything_but_a_request_error(value: Any) -> None:
    try:
        parse(json.dumps(value))
    except RequestError:
        return


@given(st.text(max_size=200))
def test_no_text_raises_anything_but_a_request_error(text: str) -> None:
    try:
        parse(text)
    except RequestError:
        return


def test_an_answer_carries_the_number_of_its_request() -> None:
    values = json.loads(Answer(7, False, "no", {"result": "LOST"}).as_json())
    assert values == {"answer": 7, "ok": False, "text": "no", "last": True, "result": "LOST"}
