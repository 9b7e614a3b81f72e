"""A YAML file that cannot be used is one line and never a hang, whoever reads it."""

import os
from pathlib import Path

import pytest

from vergence_rig.rig import RigError, default_rig
from vergence_rig.rig_file import load_rig
from vergence_rig.yaml_file import YamlFileError, parse_yaml, read_yaml

HOSTILE = {
    "nesting": ("a: " + "[" * 5000 + "]" * 5000, "nested at most 20 deep"),
    "mappings": ("{a: " * 500 + "1" + "}" * 500, "nested at most 20 deep"),
    "digits": ("baseline_m: " + "9" * 400, "at most 20 digits: got 400"),
    "more digits": ("baseline_m: " + "9" * 5000, "at most 20 digits: got 5000"),
    "duplicate": ("baseline_m: 0.065\nbaseline_m: 0.1\n", "the key 'baseline_m' must stand once"),
    "below": ("joints:\n  tilt: {lower_rad: -1, lower_rad: -2}\n", "the key 'lower_rad' must stand once"),
    "tabs": ("joints:\n\ttilt: {}\n", "is not YAML"),
    "tag": ("a: !!python/object:os.system {}\n", "is not YAML"),
    "control": ("a: \x01\n", "is not YAML"),
    "date": ("a: 2001-99-99\n", "is not YAML"),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_texts_are_one_line(name: str, tmp_path: Path) -> None:
    text, expected = HOSTILE[name]
    path = tmp_path / "rig.yaml"
    path.write_text(text)
    with pytest.raises(RigError) as refusal:
        load_rig(path)
    message = str(refusal.value)
    assert message.startswith(f"rig file '{path}' is not YAML: ")
    assert expected in message
    assert "\n" not in message
    assert len(message) < 500


def test_files_that_are_no_small_regular_file(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with (tmp_path / "large").open("wb") as file:
        file.truncate(2_000_000)
    (tmp_path / "binary").write_bytes(b"a: \xff\xfe\n")
    expected = {
        "pipe": "must be a regular file",
        "large": "at most 1000000 bytes: got 2000000",
        "binary": "text in UTF-8",
        ".": "Is a directory",
        "absent": "No such file",
    }
    for name, text in expected.items():
        with pytest.raises(YamlFileError, match=text):
            read_yaml(tmp_path / name)
    with pytest.raises(YamlFileError, match="regular file"):
        read_yaml("/dev/zero")


def test_what_is_fine_is_read_as_before(tmp_path: Path) -> None:
    assert parse_yaml("a: {b: [1, 2.5, true, x]}\nc: &d {e: 1}\nf: {<<: *d, e: 2}\n") == {
        "a": {"b": [1, 2.5, True, "x"]},
        "c": {"e": 1},
        "f": {"e": 2},
    }
    path = tmp_path / "rig.yaml"
    path.write_text("baseline_m: 0.065\n")
    assert load_rig(path) == default_rig()
