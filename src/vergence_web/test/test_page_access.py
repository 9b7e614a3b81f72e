"""Who may open the page."""

from pathlib import Path

import pytest

from vergence_rig.parameters import ParameterError
from vergence_web.access import LEAST_TOKEN, Access, is_loopback, page_urls, read_token
from vergence_web.rate_limit import FailureLimit, RateLimit

LAN = "192.0.2.7"


@pytest.mark.parametrize(
    ("address", "alone"),
    [("127.0.0.1", True), ("127.1.2.3", True), ("::1", True), ("localhost", True), ("0.0.0.0", False), (LAN, False)],
)
def test_only_loopback_addresses_are_of_this_machine_alone(address: str, alone: bool) -> None:
    assert is_loopback(address) is alone
    assert bool(read_token("", address)) is not alone


def test_a_name_is_no_address_to_listen_on() -> None:
    with pytest.raises(ParameterError, match="'address' must be an IP address of this machine"):
        is_loopback("robot.example")


def test_a_new_token_every_time() -> None:
    one, other = read_token("", "0.0.0.0"), read_token("", "0.0.0.0")
    assert one != other
    assert len(one) >= 2 * LEAST_TOKEN


def test_a_token_of_a_file(tmp_path: Path) -> None:
    path = tmp_path / "token"
    path.write_text("a_token-of-20-letter\n")
    assert read_token(str(path), "127.0.0.1") == "a_token-of-20-letter"


@pytest.mark.parametrize("text", ["", "short", "x" * 257, "sixteen letters and blanks", "ä" * 20, "a\nb" * 20])
def test_a_file_without_a_token_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "token"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ParameterError, match="'token_file' must be the path of a file with one line"):
        read_token(str(path), LAN)


def test_a_file_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="token_file"):
        read_token(str(tmp_path / "absent"), LAN)


def test_a_token_is_known_by_itself_only() -> None:
    access = Access("right-token-right-token", LAN)
    assert access.knows("right-token-right-token")
    assert not any(access.knows(other) for other in (None, "", "right-token-right-toke", "ä"))


@pytest.mark.parametrize("host", ["localhost:8470", "127.0.0.1:8470", "127.0.0.1", "[::1]:8470", "localhost:9000"])
def test_own_names_are_hosts_of_a_page_without_token(host: str) -> None:
    assert Access("", "127.0.0.1").host_refusal(host) == ""


@pytest.mark.parametrize("host", ["evil.example:8470", "127.0.0.1.evil.example", "192.0.2.9", "", None, "[bad"])
def test_a_foreign_host_is_refused_without_token(host: str | None) -> None:
    assert "Host must be localhost" in Access("", "127.0.0.1").host_refusal(host)


@pytest.mark.parametrize(
    ("origin", "host", "allowed"),
    [
        ("http://localhost:8470", "localhost:8470", True),
        ("https://robot.example", "robot.example", True),
        ("http://evil.example", "localhost:8470", False),
        ("http://localhost:1", "localhost:8470", False),
        ("null", "null", False),
        (None, "localhost:8470", False),
        ("http://localhost:8470", None, False),
    ],
)
def test_only_the_page_itself_opens_a_socket(origin: str | None, host: str | None, allowed: bool) -> None:
    assert (Access.origin_refusal(origin, host) == "") is allowed


def test_urls_carry_the_token_and_every_address() -> None:
    assert page_urls("127.0.0.1", 8470, "", [LAN]) == ["http://127.0.0.1:8470/"]
    assert page_urls("0.0.0.0", 8470, "t", ["robot", LAN]) == [
        "http://robot:8470/?token=t",
        f"http://{LAN}:8470/?token=t",
    ]
    assert page_urls("::1", 1, "", []) == ["http://[::1]:1/"]


def test_a_rate_allows_a_burst_and_then_its_rate() -> None:
    limit = RateLimit(2.0, 3.0)
    assert [limit.allows(0.0) for _ in range(4)] == [True, True, True, False]
    assert [limit.allows(0.5), limit.allows(0.5)] == [True, False]
    assert [limit.allows(100.0) for _ in range(4)] == [True, True, True, False]
    assert not limit.allows(50.0)  # a clock that runs back gives nothing


def test_an_address_that_fails_too_often_has_to_wait() -> None:
    limit = FailureLimit(0.1, 2.0)
    for _ in range(2):
        assert limit.may_try(LAN, 0.0)
        limit.failed(LAN, 0.0)
    assert not limit.may_try(LAN, 0.0)
    assert limit.may_try("192.0.2.8", 0.0)
    assert limit.may_try(LAN, 11.0)


def test_many_addresses_do_not_fill_the_memory() -> None:
    limit = FailureLimit(0.1, 1.0)
    for number in range(5000):
        limit.failed(str(number), 0.0)
    assert len(limit._limits) <= 1024
