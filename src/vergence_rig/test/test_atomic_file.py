"""A file is the old one or the new one, never half of it."""

import os
from pathlib import Path

import pytest

from vergence_rig.atomic_file import write_atomically


def test_writes_into_a_folder_that_is_not_there_yet_for_all_to_read(tmp_path: Path) -> None:
    path = tmp_path / "a" / "b" / "pose.json"
    write_atomically(path, "höhe: 1\n")
    assert path.read_text(encoding="utf-8") == "höhe: 1\n"
    assert path.stat().st_mode & 0o777 == 0o644
    assert os.listdir(path.parent) == ["pose.json"]


def test_a_replaced_file_keeps_its_permissions(tmp_path: Path) -> None:
    path = tmp_path / "left.yaml"
    path.write_text("old")
    path.chmod(0o600)
    write_atomically(path, "new")
    assert (path.read_text(), path.stat().st_mode & 0o777) == ("new", 0o600)


def test_a_reader_that_holds_the_old_file_open_goes_on_reading_it(tmp_path: Path) -> None:
    path = tmp_path / "left.yaml"
    path.write_text("old " * 1000)
    with path.open() as reader:
        start = reader.read(4)
        write_atomically(path, "new")
        assert start + reader.read() == "old " * 1000


@pytest.mark.parametrize("failing", ["fsync", "replace"])
def test_a_failure_leaves_the_old_file_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, failing: str
) -> None:
    path = tmp_path / "left.yaml"
    path.write_text("old")

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, failing, full)
    with pytest.raises(OSError, match="No space left"):
        write_atomically(path, "new")
    assert (path.read_text(), os.listdir(tmp_path)) == ("old", ["left.yaml"])
