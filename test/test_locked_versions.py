"""Every package that the bootstrap installs has one exact version, on every Python that it accepts."""

import os
import re
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path

import pytest
from packaging.markers import default_environment
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[1]
PYTHONS = ("3.10", "3.11", "3.12", "3.13", "3.14")
WHEELS = ("requirements/lock.txt", ("run.txt", "ros.txt", "dev.txt"), PYTHONS)
BESIDE_APT = ("requirements/lock_apt.txt", ("beside_apt.txt", "dev.txt", "apt_versions.txt"), ("3.12",))
HERE = Path(os.environ.get("VERGENCE_ROS_SETUP", "/opt/ros/jazzy/setup.bash")).is_file()


def requirements(path: Path) -> Iterator[Requirement]:
    """Yield what a requirements file asks for, included files too."""
    for line in path.read_text(encoding="utf-8").splitlines():
        text = line.split("#")[0].strip()
        if text.startswith("-r "):
            yield from requirements(path.parent / text[3:].strip())
        elif text:
            yield Requirement(text)


def environment(python: str, machine: str = "x86_64") -> dict[str, str]:
    own = {key: str(value) for key, value in default_environment().items()}
    return own | {"python_version": python, "python_full_version": f"{python}.1", "platform_machine": machine}


def pins(lock: str, python: str, machine: str = "x86_64") -> dict[str, list[str]]:
    """Return {name: versions} of a lock for one Python."""
    found: dict[str, list[str]] = {}
    for requirement in requirements(ROOT / lock):
        exact = re.fullmatch(r"==[^*]+", str(requirement.specifier))
        assert exact, f"{lock}: {requirement} is no exact version"
        if requirement.marker is None or requirement.marker.evaluate(environment(python, machine)):
            found.setdefault(canonicalize_name(requirement.name), []).append(str(requirement.specifier)[2:])
    return found


@pytest.mark.parametrize("machine", ["x86_64", "aarch64"])
@pytest.mark.parametrize(
    ("lock", "files", "python"),
    [(lock, files, python) for lock, files, pythons in (WHEELS, BESIDE_APT) for python in pythons],
)
def test_every_requirement_has_one_exact_version(lock: str, files: tuple[str, ...], python: str, machine: str) -> None:
    versions = pins(lock, python, machine)
    assert all(len(exact) == 1 for exact in versions.values())
    for file in files:
        for wanted in requirements(ROOT / "requirements" / file):
            exact = versions.get(canonicalize_name(wanted.name))
            assert exact, f"{lock} has no version of {wanted.name} for Python {python}: run tools/lock.sh --keep"
            assert wanted.specifier.contains(exact[0]), f"{lock}: {wanted.name} {exact[0]} does not fit {wanted}"


@pytest.mark.skipif(HERE, reason="beside an apt ROS some packages are the system's")
def test_what_is_installed_is_what_is_locked() -> None:
    """And what the requirements need in turn is locked too."""
    python = ".".join(default_environment()["python_full_version"].split(".")[:2])
    versions = pins("requirements/lock.txt", python)
    waiting = [
        need for file in ("run.txt", "ros.txt", "dev.txt") for need in requirements(ROOT / "requirements" / file)
    ]
    seen: set[tuple[str, str]] = set()
    while waiting:
        need = waiting.pop()
        name = canonicalize_name(need.name)
        for extra in {"", *need.extras} - {extra for other, extra in seen if other == name}:
            seen.add((name, extra))
            waiting += [
                inner
                for inner in map(Requirement, metadata.requires(name) or ())
                if inner.marker is None or inner.marker.evaluate(environment(python) | {"extra": extra})
            ]
    names = {name for name, _ in seen}
    assert len(names) > 150
    assert {name: [metadata.version(name)] for name in names} == {name: versions.get(name) for name in names}


def test_no_lock_names_an_index() -> None:
    for lock, _, _ in (WHEELS, BESIDE_APT):
        assert not re.search(r"://|--(index|extra|find)", (ROOT / lock).read_text(encoding="utf-8"))
