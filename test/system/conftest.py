"""What system tests share: two machines in one, joined by a cable."""

import os
import shutil
import subprocess
from collections.abc import Iterator

import pytest


def ip(*arguments: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(["ip", *arguments], capture_output=True, text=True, timeout=60)


class Cable:
    """Two namespaces, `laptop` and `pi`, each with one end of a veth pair."""

    def __init__(self) -> None:
        self.name = f"vg{os.getpid()}"
        self.laptop, self.pi = f"{self.name}_laptop", f"{self.name}_pi"

    def lay(self) -> None:
        """Make the namespaces and join them. Raises OSError where this machine does not allow it."""
        ends = ((self.laptop, f"{self.name}l", "10.98.76.1/24"), (self.pi, f"{self.name}p", "10.98.76.2/24"))
        for namespace, _, _ in ends:
            self._do("netns", "add", namespace)
        self._do("link", "add", ends[0][1], "netns", self.laptop, "type", "veth", "peer", ends[1][1], "netns", self.pi)
        for namespace, link, address in ends:
            self._do("-n", namespace, "addr", "add", address, "dev", link)
            self._do("-n", namespace, "link", "set", "lo", "up")
            self._do("-n", namespace, "link", "set", link, "up", "multicast", "on")
            self._do("-n", namespace, "route", "add", "224.0.0.0/4", "dev", link)

    def pull(self) -> None:
        self._do("-n", self.laptop, "link", "set", f"{self.name}l", "down")

    def plug(self) -> None:
        self._do("-n", self.laptop, "link", "set", f"{self.name}l", "up")
        self._do("-n", self.laptop, "route", "replace", "224.0.0.0/4", "dev", f"{self.name}l")

    def throttle(self, rate: str) -> None:
        """Let no more than `rate` (as tc writes it: 1mbit) through from the laptop to the Pi, and hold 512 kB back."""
        arguments = f"qdisc add dev {self.name}l root tbf rate {rate} burst 16kb limit 512kb".split()
        done = subprocess.run(["tc", "-n", self.laptop, *arguments], capture_output=True, text=True, timeout=60)
        if done.returncode:
            raise OSError(f"tc {' '.join(arguments)}: {done.stderr.strip()}")

    def remove(self) -> None:
        for namespace in (self.laptop, self.pi):
            ip("netns", "del", namespace)

    def _do(self, *arguments: str) -> None:
        done = ip(*arguments)
        if done.returncode:
            raise OSError(f"ip {' '.join(arguments)}: {done.stderr.strip()}")


@pytest.fixture
def cable() -> Iterator[Cable]:
    if os.geteuid() != 0 or shutil.which("ip") is None:
        pytest.skip("network namespaces need root and the ip command")
    made = Cable()
    try:
        try:
            made.lay()
        except OSError as error:
            pytest.skip(f"this machine gives no network namespaces: {error}")
        yield made
    finally:
        made.remove()
