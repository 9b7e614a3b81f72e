"""Reads keys and lines from a terminal, and draws a table in place."""

import os
import select
import sys
import termios
import tty
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

_SEQUENCES = {
    "[A": "up",
    "[B": "down",
    "[C": "right",
    "[D": "left",
    "OA": "up",
    "OB": "down",
    "OC": "right",
    "OD": "left",
    "[5~": "page_up",
    "[6~": "page_down",
}
_SEQUENCE_TIMEOUT_S = 0.05


class NoTerminalError(ValueError):
    """Standard input is not a terminal: keys cannot be read."""


class Terminal:
    """The terminal that standard input and output are on. Raises NoTerminalError where there is none."""

    def __init__(self) -> None:
        if not sys.stdin.isatty():
            raise NoTerminalError("standard input must be an interactive terminal (ssh -t)")
        self._drawn = 0

    @contextmanager
    def keys(self) -> Iterator[None]:
        """Within the block keys arrive one by one; Ctrl-C still interrupts."""
        before = termios.tcgetattr(sys.stdin)
        try:
            tty.setcbreak(sys.stdin)
            yield
        finally:
            termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)

    def key(self) -> str:
        """Wait for a key and return its name: a character, "enter", "escape", or an arrow or page key."""
        first = self._read()
        if first in ("\r", "\n"):
            return "enter"
        if first != "\x1b":
            return first
        sequence = ""
        while select.select([sys.stdin.fileno()], [], [], _SEQUENCE_TIMEOUT_S)[0] and sequence not in _SEQUENCES:
            sequence += self._read()
        return _SEQUENCES.get(sequence, "escape")

    def line(self, question: str) -> str:
        """Ask and return the line that is typed; call within `keys`: what is typed is echoed here."""
        sys.stdout.write(question)
        sys.stdout.flush()
        text = ""
        while (character := self._read()) not in ("\n", "\r"):
            if character in ("\x7f", "\b"):
                text, character = text[:-1], "\b \b" if text else ""
            elif character.isprintable():
                text += character
            else:
                continue
            sys.stdout.write(character)
            sys.stdout.flush()
        sys.stdout.write("\n")
        self._drawn = 0
        return text.strip()

    def print_line(self, text: str) -> None:
        """Print a line that stays."""
        sys.stdout.write(text + "\n")
        sys.stdout.flush()
        self._drawn = 0

    def draw(self, lines: Sequence[str]) -> None:
        """Print lines over those drawn last."""
        if self._drawn:
            sys.stdout.write(f"\033[{self._drawn}A")
        sys.stdout.write("".join(f"\033[2K{line}\n" for line in lines))
        sys.stdout.flush()
        self._drawn = len(lines)

    def _read(self) -> str:
        # not sys.stdin.read: its buffer would hide keys from select
        data = os.read(sys.stdin.fileno(), 1)
        if not data:
            raise NoTerminalError("the terminal was closed")
        return data.decode(errors="replace")
