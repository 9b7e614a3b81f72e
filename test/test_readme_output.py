"""README's commands that need no running graph end well, and its samples of output are what they print."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
NUMBER = re.compile(r"[-+]?\d+\.\d+")
TOLERANCE_PX = 0.5
"""Versions of OpenCV and onnxruntime differ by less."""


def sample() -> str:
    """Return the block of README that begins with the detector's boxes."""
    (block,) = re.findall(r"```\n(boxes: .*?)```", README, flags=re.DOTALL)
    return str(block)


def command() -> list[str]:
    """Return the command line that README gives for it."""
    (line,) = re.findall(r"^(vergence measure .* --model yolo\.onnx .*?) +#", README, flags=re.MULTILINE)
    (given,) = re.findall(r"Try the last one with `(.*?)`", README.replace("\n", " "))
    left, right, *options = shlex.split(given)
    words = shlex.split(line)
    return [*words[1:2], left, right, *options, *words[-2:]]


def test_measuring_the_shipped_pair_prints_the_sample(tmp_path: Path) -> None:
    pytest.importorskip("onnxruntime", reason="onnxruntime is not installed here")
    arguments = command()
    assert arguments[-2] == "--out"
    arguments[-1] = str(tmp_path)
    ran = subprocess.run(
        [sys.executable, "-m", "vergence_bringup.command_line", *arguments],
        capture_output=True,
        text=True,
        timeout=240,
        cwd=ROOT,
    )
    assert ran.returncode == 0, ran.stderr
    printed = ran.stdout[ran.stdout.index("boxes:") :].splitlines()[: len(sample().splitlines())]
    text = "\n".join(printed) + "\n"
    assert NUMBER.sub("#", text) == NUMBER.sub("#", sample())
    values = [[float(number) for number in NUMBER.findall(part)] for part in (text, sample())]
    assert values[0] == pytest.approx(values[1], abs=TOLERANCE_PX), f"README's sample is stale: it prints\n{text}"
    assert (tmp_path / "boxes.png").is_file()


def simple_commands() -> list[str]:
    """Return README's commands that need neither a graph nor a head: on stored images, and questions to the machine."""
    lines = re.findall(
        r"^((?:vergence (?:doctor|measure)|ros2 run vergence_camera list_cameras)\b[^#\n]*)", README, re.M
    )
    return [line.strip() for line in lines if "yolo.onnx" not in line]


@pytest.mark.parametrize("line", simple_commands())
def test_a_command_of_readme_ends_well(line: str, tmp_path: Path) -> None:
    words = shlex.split(line)
    if words[0] == "ros2":  # finds the executable where setup.bash has put it
        words = [str(ROOT / "install" / words[2] / "lib" / words[2] / words[3])]
        if not Path(words[0]).exists():
            pytest.skip("the workspace is not built here")
    else:
        words = [sys.executable, "-m", "vergence_bringup.command_line", *words[1:]]
    images = {"left.jpg": ROOT / "docs/images/cube_left.jpg", "right.jpg": ROOT / "docs/images/cube_right.jpg"}
    words = [str(images.get(word, tmp_path / word if word == "measured" else word)) for word in words]
    ran = subprocess.run(words, capture_output=True, text=True, timeout=240, cwd=tmp_path)
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout
    assert "Traceback" not in ran.stderr


def test_readme_has_such_commands() -> None:
    assert {line.split()[1] for line in simple_commands()} == {"doctor", "measure", "run"}
