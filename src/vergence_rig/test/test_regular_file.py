"""What a user names is opened only if it is a regular file of a bounded size, whatever it is."""

import os
import socket
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from vergence_rig.regular_file import FileError, check_regular_file, expanded, read_regular_file


def _fifo(path: Path) -> None:
    os.mkfifo(path)


def _folder(path: Path) -> None:
    path.mkdir()


def _socket(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(path))


@pytest.mark.parametrize(
    ("make", "kind"),
    [(_fifo, "Is a pipe"), (_folder, "Is a directory"), (_socket, "Is a socket")],
    ids=lambda value: str(value),
)
def test_what_is_no_regular_file_is_named_and_never_waited_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, make: Callable[[Path], None], kind: str
) -> None:
    monkeypatch.chdir(tmp_path)  # the path of a socket is short
    make(Path("x"))
    for read in (check_regular_file, read_regular_file):
        failures: list[FileError] = []

        def attempt(read: Callable[[str], object] = read, failures: list[FileError] = failures) -> None:
            try:
                read("x")
            except FileError as error:
                failures.append(error)

        thread = threading.Thread(target=attempt, daemon=True)
        thread.start()
        thread.join(20.0)
        assert not thread.is_alive()
        assert kind in str(failures[0])


@pytest.mark.parametrize("path", ["/dev/zero", "/dev/null", "/dev/tty"])
def test_a_device_is_refused(path: str) -> None:
    with pytest.raises(FileError, match=r"cannot be read: \w"):
        read_regular_file(path)


def test_a_file_without_a_size_is_read_up_to_the_limit() -> None:
    with pytest.raises(FileError, match="at most 10 bytes: got more"):
        read_regular_file("/proc/self/maps", 10)


def test_the_size_is_looked_at_before_the_file_is_read(tmp_path: Path) -> None:
    sparse = tmp_path / "sparse"
    with sparse.open("wb") as file:
        file.truncate(1 << 40)
    with pytest.raises(FileError, match=f"at most 100 bytes: got {1 << 40}"):
        read_regular_file(sparse, 100)


@pytest.mark.parametrize("path", ["", "no\0path", "x" * 5000, "/absent/file"])
def test_a_path_that_cannot_be_is_an_error_of_the_same_kind(path: str) -> None:
    with pytest.raises(FileError, match="cannot be read"):
        read_regular_file(path)


def test_the_home_folder_is_expanded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    (tmp_path / "x").write_bytes(b"123")
    assert read_regular_file("~/x") == b"123"
    assert expanded("~/x") == tmp_path / "x"
    assert expanded("~no_such_user_here/x") == Path("~no_such_user_here/x")
    assert expanded("/a/~/b") == Path("/a/~/b")
