"""The address of the page is read from web_node's log."""

from pathlib import Path

import pytest

from vergence_bringup.graph_errors import ProcessError
from vergence_bringup.page_address import page_address


def alive() -> None:
    return


def test_the_first_address_is_returned(tmp_path: Path) -> None:
    log = tmp_path / "log"
    log.write_text("something else\n[INFO] [web_node]: the page: http://robot:1/?token=x\n... the page: http://b/\n")
    assert page_address(log, alive) == "http://robot:1/?token=x"


def test_a_line_that_is_being_written_is_waited_for(tmp_path: Path) -> None:
    log = tmp_path / "log"
    log.write_text("the page: http://127.0.0.1:84")

    def write_on() -> None:
        log.write_text("the page: http://127.0.0.1:8470/\n")

    assert page_address(log, write_on) == "http://127.0.0.1:8470/"


def test_a_node_that_has_ended_has_none(tmp_path: Path) -> None:
    log = tmp_path / "log"
    log.write_text("no aiohttp\n")

    def ended() -> None:
        raise ProcessError("web_node ended with status 1")

    with pytest.raises(ProcessError, match="web_node ended"):
        page_address(log, ended)
